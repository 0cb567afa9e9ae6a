"""Unguessable tokens, their hashes at rest, and keyed hashes."""

from __future__ import annotations

import hashlib
import hmac
import secrets

_ALPHABET = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ"


def new_token() -> str:
    """A random token of 192 bits for links, trials and clips."""
    return secrets.token_urlsafe(24)


def new_code(length: int = 8) -> str:
    """A random code that people can copy by hand (no 0, O, 1, I)."""
    return "".join(secrets.choice(_ALPHABET) for _ in range(length))


def token_hash(token: str) -> str:
    """What is stored of a token: tokens are random, so a plain hash cannot be reversed."""
    return hashlib.sha256(token.encode()).hexdigest()


def keyed_hash(key: str, *parts: str) -> str:
    """A hash that nobody can recompute without the key."""
    return hmac.new(key.encode(), "\x1f".join(parts).encode(), hashlib.sha256).hexdigest()


def group_name(group_key: str, ticket_hash: str, method: str) -> str:
    """The opaque name under which a ticket's simulated participants see a method's clips.

    Without the study's key, which never leaves the database, method names cannot be tried out.
    """
    return "g" + keyed_hash(group_key, ticket_hash, method)[:12]
