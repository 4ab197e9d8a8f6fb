"""Control: laws behind one interface, gains per phase, and the sampled-loop check."""
