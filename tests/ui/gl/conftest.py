"""One headless context per file; every test draws with clean state and its objects are freed afterwards."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import pytest

from tests.ui.gl.keep import Keep, Releasable, Thing
from ui.gl.context import ContextError, free_dropped, make_headless_context


@pytest.fixture(scope="module")
def module_context() -> Iterator[moderngl.Context]:
    """Skips with the reason where no context can be made.

    One per file and not per session: while it exists, moderngl cannot attach to the headless windows of other tests.
    """
    try:
        context = make_headless_context()
    except ContextError as error:
        pytest.skip(str(error))
    yield context
    context.release()


@pytest.fixture
def ctx(module_context: moderngl.Context) -> Iterator[moderngl.Context]:
    """The context, current during the test; a GL error left behind fails the test."""
    with module_context:
        yield module_context
        assert module_context.error == "GL_NO_ERROR"
        free_dropped(module_context)


@pytest.fixture
def keep(ctx: moderngl.Context) -> Iterator[Keep]:
    """Hands its argument back and releases it after the test, newest first."""
    kept: list[Releasable] = []

    def remember(thing: Thing) -> Thing:
        kept.append(thing)
        return thing

    yield remember
    for thing in reversed(kept):
        thing.release()
