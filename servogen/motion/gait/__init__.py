"""Walking: phases, footholds, footwork, stability."""
