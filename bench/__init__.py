"""Benchmarks: `python -m bench`. Peers run in turns with map3d. Read figures as ratios, because machines are shared."""
