"""The shared parts of the server: a request's name and handler, its body, and answers in JSON."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from typing import Any

from aiohttp import web
from aiohttp.http import HttpProcessingError

from fusesoc_firm.text.json_text import json_text

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
Requests = dict[str, Handler]
"""Handlers by method and name, such as `GET scene`."""


async def body_of(request: web.Request) -> dict[str, Any]:
    """Return the mapping that a request sends; raise 400 for anything else."""
    try:
        body = await request.json()
        # No file can contain a lone surrogate, which JSON's escapes can express.
        json.dumps(body, ensure_ascii=False).encode()
    # Python also refuses to read or print a number of thousands of digits.
    except (ValueError, RecursionError, web.RequestPayloadError, HttpProcessingError):
        body = None
    if not isinstance(body, dict):
        raise web.HTTPBadRequest(reason="the request is not a mapping in JSON")
    return body


def number_of(request: web.Request, name: str) -> int:
    """Return a number in a request's address; raise 400 for anything else."""
    text = request.query.get(name, "")
    if not (text.isascii() and text.isdecimal()) or len(text) > 15:
        raise web.HTTPBadRequest(reason=f"'{name}' is a whole number")
    return int(text)


def in_json(data: object, status: int = 200) -> web.Response:
    """Return an answer in JSON."""
    return web.json_response(data, status=status, dumps=json_text)
