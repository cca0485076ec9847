"""Patches between two values of plain JSON data: the differences, and nothing else.

A patch is plain data, too:

    {"is": value}                               another value
    {"in": {name: patch}, "out": [names]}       an object: entries that differ or are new, and those that are gone
    {"items": [[first, stop], {"of": i, ...patch}, {"is": value}]}
                                                a list, item by item: items [first, stop) of the list before as they
                                                were, its item i with a patch, or a new value
"""

from __future__ import annotations

from typing import Any

Patch = dict[str, Any]


class PatchError(ValueError):
    """A patch does not fit its value. The text fits into brackets."""


def difference(before: Any, after: Any) -> Patch | None:
    """The patch that makes `after` of `before`; None where both are the same to the last sign and digit."""
    if isinstance(before, dict) and isinstance(after, dict):
        return _of_objects(before, after)
    if isinstance(before, list) and isinstance(after, list):
        return _of_lists(before, after)
    if type(before) is not type(after) or before != after:  # 1, 1.0 and true are equal to Python
        return {"is": after}
    return {"is": after} if isinstance(after, float) and repr(before) != repr(after) else None  # 0.0 and -0.0, too


def _of_objects(before: dict[str, Any], after: dict[str, Any]) -> Patch | None:
    inner = {}
    for name, value in after.items():
        patch = difference(before[name], value) if name in before else {"is": value}
        if patch is not None:
            inner[name] = patch
    gone = [name for name in before if name not in after]
    if not inner and not gone:
        return None
    return {"in": inner} | ({"out": gone} if gone else {})


def _of_lists(before: list[Any], after: list[Any]) -> Patch | None:
    if not any(isinstance(item, dict | list) for item in after):
        is_same = len(before) == len(after) and all(map(_is_same, before, after))
        return None if is_same else {"is": after}
    n_both = min(len(before), len(after))
    head = next((i for i in range(n_both) if not _is_same(before[i], after[i])), n_both)
    rest = n_both - head
    tail = next((i for i in range(rest) if not _is_same(before[-1 - i], after[-1 - i])), rest)
    if head == len(before) == len(after):
        return None
    old, new = before[head : len(before) - tail], after[head : len(after) - tail]
    items: list[Any] = [[0, head]] if head else []
    for i, item in enumerate(new):
        patch = difference(old[i], item) if len(old) == len(new) else {"is": item}
        if patch is None:
            items.append([head + i, head + i + 1])
        else:
            items.append(patch if "is" in patch else {"of": head + i, **patch})
    if tail:
        items.append([len(before) - tail, len(before)])
    return {"items": items}


def _is_same(before: Any, after: Any) -> bool:
    return before is after or difference(before, after) is None


def patched(before: Any, patch: Any) -> Any:
    """The value with the patch applied.

    Raises:
        PatchError: It is not a patch, or one for another value.
    """
    if not isinstance(patch, dict):
        raise PatchError("a patch is not an object")
    if patch.keys() == {"is"}:
        return patch["is"]
    if patch.keys() == {"items"}:
        return _patched_list(before, patch["items"])
    if "in" in patch and patch.keys() <= {"in", "out"}:
        return _patched_object(before, patch["in"], patch.get("out", []))
    raise PatchError(f"a patch has the entries {', '.join(patch):.100}")


def _patched_object(before: Any, inner: Any, gone: Any) -> dict[str, Any]:
    if not (isinstance(before, dict) and isinstance(inner, dict) and isinstance(gone, list)):
        raise PatchError("a patch of an object is for something else")
    if any(not isinstance(name, str) or name not in before or name in inner for name in gone):
        raise PatchError("a patch takes out what is not there")
    after = {name: value for name, value in before.items() if name not in gone}
    for name, patch in inner.items():
        if name not in before and not (isinstance(patch, dict) and patch.keys() == {"is"}):
            raise PatchError(f"a patch changes the entry {name!r:.60}, which is not there")
        after[name] = patched(before.get(name), patch)
    return after


def _patched_list(before: Any, items: Any) -> list[Any]:
    if not isinstance(before, list):
        raise PatchError("a patch of a list is for something else")
    after: list[Any] = []
    for piece in pieces_of(items, len(before)):
        match piece:
            case (int(first), int(stop)):
                after += before[first:stop]
            case (int(index), dict(patch)):
                after.append(patched(before[index], patch))
            case (None, value):
                after.append(value)
    return after


def pieces_of(items: Any, n_before: int) -> list[tuple[Any, Any]]:
    """The pieces of a patch of a list: (first, stop) of items as they were, (index, patch), or (None, value).

    Args:
        n_before: Items of the list before.
    Raises:
        PatchError: It is not such a patch, or names items that are not there.
    """
    if not isinstance(items, list):
        raise PatchError("the items of a patch are not a list")
    found: list[tuple[Any, Any]] = []
    for item in items:
        if isinstance(item, list):
            if len(item) != 2 or any(type(end) is not int for end in item) or not 0 <= item[0] < item[1] <= n_before:
                raise PatchError(f"a patch keeps items {item!r:.60} of {n_before}")
            found.append((item[0], item[1]))
        elif isinstance(item, dict) and "of" in item:
            index = item["of"]
            if type(index) is not int or not 0 <= index < n_before:
                raise PatchError(f"a patch changes item {index!r:.20} of {n_before}")
            found.append((index, {name: value for name, value in item.items() if name != "of"}))
        elif isinstance(item, dict) and item.keys() == {"is"}:
            found.append((None, item["is"]))
        else:
            raise PatchError("an item of a patch is neither kept, changed nor new")
    return found
