"""Exit codes of commands that need no ROS."""

EXIT_OK = 0
EXIT_LOSS = 3  # what was asked for is done, but something of the recording is missing
