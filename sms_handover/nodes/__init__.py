"""One file per node: parameters, messages in, a call of the core, messages out."""
