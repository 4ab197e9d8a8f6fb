"""Exit codes of the commands; the main program imports them before it has looked where modules come from."""

EXIT_OK, EXIT_FAILED, EXIT_USAGE = 0, 1, 2
EXIT_LOSS = 3  # what was asked for is done, but something of the recording is missing
EXIT_MISSED, EXIT_INTERRUPTED = 4, 130
EXIT_UNSUPPORTED = 5  # the engine asked for does not know something that the recording has
