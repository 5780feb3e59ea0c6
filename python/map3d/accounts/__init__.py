"""Accounts: who may change a workspace through the web. Passwords, tokens, the key of sessions, limits of failed sign-ins."""

from map3d.accounts.accounts import Accounts, Identity, check_user_name
from map3d.accounts.sessions import Session, Sessions
from map3d.accounts.sign_in_limits import SignInLimits, TooManySignIns

__all__ = ["Accounts", "Identity", "Session", "Sessions", "SignInLimits", "TooManySignIns", "check_user_name"]
