"""The command line: a file each for a command and its options."""
