"""Web server of the demonstration page: access, commands, pictures and states."""
