"""Measurements, in folders by purpose; `make bench` and its kin run them (bench/run.py)."""
