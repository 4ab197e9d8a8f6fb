"""The launcher: starts the processes of a graph, monitors the run, and ends them whatever happens."""
