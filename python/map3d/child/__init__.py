"""Child processes: one long-lived child does what it is asked, one thing after another, and can take nothing down but itself."""

from map3d.child.channel import Channel, Message
from map3d.child.limits import Limits
from map3d.child.process import Child, Failure
from map3d.child.work import Tell, Work

__all__ = ["Channel", "Child", "Failure", "Limits", "Message", "Tell", "Work"]
