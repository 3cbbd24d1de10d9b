from importlib.util import find_spec

# the logic is tested without any build; this one needs the built messages
collect_ignore = [] if find_spec("cliport_interfaces") else ["test_messages.py"]
