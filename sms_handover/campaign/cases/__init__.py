"""Cases: one run of a campaign as a pure function, and the process that carries it out."""
