"""The launcher: starts the processes of a graph, watches the run, and ends them whatever happens."""
