"""The web side of the demonstration page: who may ask, what is answered, how pictures and states are pushed."""
