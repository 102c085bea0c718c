"""Facts about any program, derived from its words: what can happen on some path, and how long paths take."""
