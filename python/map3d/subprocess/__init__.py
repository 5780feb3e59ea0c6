"""Subprocesses: a long-lived process under a worker handles one request after another, under limits, and can crash without harm to its parent."""

from map3d.subprocess.channel import Channel, Handler, Message, ReportProgress
from map3d.subprocess.limits import Limits
from map3d.subprocess.process import Failure, Subprocess

__all__ = ["Channel", "Failure", "Handler", "Limits", "Message", "ReportProgress", "Subprocess"]
