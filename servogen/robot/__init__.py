"""Robots as data: joints, link lengths, limits and mounts, from the catalogue or from a user's TOML file."""
