"""Faults on purpose: kills, full disks, failing system calls, lost servers. Every tile set must equal the undisturbed one (docs/reliability.md)."""
