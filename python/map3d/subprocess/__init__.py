"""Child processes: one long-lived child does what it is asked, one thing after another, and can take nothing down but itself."""

from map3d.subprocess.channel import Channel, Message
from map3d.subprocess.handler import Tell, Work
from map3d.subprocess.limits import Limits
from map3d.subprocess.process import Child, Failure

__all__ = ["Channel", "Child", "Failure", "Limits", "Message", "Tell", "Work"]
