"""The browser that the tests of a process share ends with them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.studio.browser import shared_browser


@pytest.fixture(scope="session", autouse=True)
def _browser() -> Iterator[None]:
    yield
    if shared_browser.cache_info().currsize:
        with shared_browser():
            pass
