"""Where shipped data files lie. Finds paths; reads nothing.

The folder `assets/` sits next to the packages `app`, `engine` and `ui`: in the repository, which an editable install
points at, and in site-packages after a plain install, because the packaging settings ship it as data.
"""

from pathlib import Path

_ROOT = Path(__file__).resolve().parent.parent / "assets"


def asset_path(*parts: str) -> Path:
    """Path of a shipped file or folder, such as `asset_path("sample")`.

    Args:
        parts: Path below `assets/`, one part each. None of them gives `assets/` itself.
    Returns:
        An absolute path. It need not exist: whoever opens it reports that.
    Raises:
        ValueError: The parts lead out of `assets/`.
    """
    path = _ROOT.joinpath(*parts).resolve()
    if not path.is_relative_to(_ROOT):
        raise ValueError(f"asset {'/'.join(parts)!r} is outside assets/")
    return path
