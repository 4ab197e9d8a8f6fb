"""Engine: what hands cases to processes, here or on a cluster, and takes rows back."""
