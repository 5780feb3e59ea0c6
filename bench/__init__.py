"""Benchmarks: `python -m bench`. Peers stand beside us in the same run; read figures as ratios, machines are shared."""
