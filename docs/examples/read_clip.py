"""Reads a frame of a trained project with nothing but Python and numpy: python read_clip.py PROJECT FRAME [OUT.npz]

It says exactly what is stored, for whoever wants to decode it elsewhere; docs/project_format.md explains the names.
It believes what it reads: checksums are left out.
"""

import json
import lzma
import sys
from pathlib import Path

import numpy as np

ROLES = ("static", "moving", "promoted", "residual", "adapted", "replacing")  # in the order in which they are decoded
PRIMES = (1, 2654435761, 805459861, 3674653429)  # of x, y, z and time
MOTION = ("birth_frames", "velocities", "accelerations")
KINDS = ("positions", "color_logits", "features", "log_offset_scales", "log_base_scales", "presence", *MOTION)
FILTERS = [{"id": lzma.FILTER_LZMA2, "preset": 6, "dict_size": 1 << 20, "lc": 0, "lp": 0, "pb": 0}]


def read_clip(path):
    """Header and arrays of a finished clip: a safetensors file whose arrays are packed as the text "coding" says."""
    data = Path(path).read_bytes()
    n_head = int.from_bytes(data[:8], "little")
    table = json.loads(data[8 : 8 + n_head])
    texts = table.pop("__metadata__")
    header, specs = json.loads(texts["header"]), json.loads(texts["coding"])
    arrays = {}
    for name, entry in table.items():
        start, stop = (8 + n_head + offset for offset in entry["data_offsets"])
        raw = lzma.decompress(data[start:stop], format=lzma.FORMAT_RAW, filters=FILTERS)
        arrays[name] = unpack(raw, specs[name])
    return header, arrays


def planes(raw, dtype):
    """Values whose first bytes come first, then all second bytes, and so on."""
    dtype = np.dtype(dtype)
    return np.frombuffer(raw, np.uint8).reshape(dtype.itemsize, -1).T.copy().reshape(-1).view(dtype)


def unpack(raw, spec):
    """An array from its bytes; each of the five codecs."""
    shape, codec = tuple(spec["shape"]), spec["codec"]
    if codec == "exact":
        return planes(raw, spec["dtype"]).reshape(shape)
    if codec == "half":
        return planes(raw, "<f2").astype(np.float32).reshape(shape)
    if codec == "bits":  # two axes: channels first
        bits = np.unpackbits(np.frombuffer(raw, np.uint8), count=int(np.prod(shape))).astype(bool)
        return bits.reshape(shape[::-1]).T if len(shape) == 2 else bits.reshape(shape)
    if codec == "lattice":  # origin, spacing, then steps from point to point: 0, -1, 1, -2 ... as 0, 1, 2, 3 ...
        n_rows, n_axes = shape
        numbers = np.frombuffer(raw[: 8 * (n_axes + 1)], "<f8")
        folded = planes(raw[8 * (n_axes + 1) :], "<u4").reshape(n_axes, n_rows).T.astype(np.int64)
        steps = np.where(folded & 1, -(folded + 1) // 2, folded // 2).cumsum(0)
        return (numbers[:n_axes] + steps * numbers[n_axes]).astype(np.float32)
    assert codec == "steps"  # per group and channel a step and a lowest step; of tables, rows of zeros are left out
    n_groups, n_rows, n_channels = shape if len(shape) == 3 else (1, *shape)
    code = np.dtype("u1" if spec["bits"] <= 8 else "<u2")
    at = 16 * n_groups * n_channels
    sizes = np.frombuffer(raw[:at], "<f8").reshape(n_groups, n_channels, 2)
    kept = np.ones((n_groups, n_rows), bool)
    if len(shape) == 3:
        n_mask = (n_groups * n_rows + 7) // 8
        kept = np.unpackbits(np.frombuffer(raw[at : at + n_mask], np.uint8), count=kept.size).reshape(kept.shape) > 0
        at += n_mask
    values = np.zeros((n_groups, n_rows, n_channels), np.float32)
    for group in range(n_groups):
        n_bytes = int(kept[group].sum()) * n_channels * code.itemsize
        codes = planes(raw[at : at + n_bytes], code).reshape(n_channels, -1)
        values[group, kept[group]] = ((codes + sizes[group, :, 1:]) * sizes[group, :, :1]).T
        at += n_bytes
    return values.reshape(shape)


def anchor_sets(header, arrays, reference):
    """The anchors of a clip by role, inherited ones too, and the light on the static ones (None without)."""
    sets, light = {}, arrays.get("inherited.static.light")
    for role in ROLES:
        own = {kind: arrays[f"sets.{role}.{kind}"] for kind in KINDS if f"sets.{role}.{kind}" in arrays}
        if header["role"] == "source" and not own:
            own = {kind: reference[f"sets.{role}.{kind}"] for kind in KINDS if f"sets.{role}.{kind}" in reference}
            if "presence" in own:  # frames of this clip in which each exists; a role that is not named is left out
                own = {kind: array for kind, array in own.items() if kind not in MOTION}
                own = own | {"presence": arrays[p]} if (p := f"inherited.{role}.presence") in arrays else {}
            hidden = arrays.get(f"inherited.{role}.is_hidden")
            if hidden is not None:
                own = {kind: array[~hidden] for kind, array in own.items()}
                light = light[~hidden] if role == "static" and light is not None else light
        if own:
            sets[role] = own
    return sets, light


def dynamic_features(positions, field, arrays, knot):
    """The spatio-temporal field at anchors and a frame of the clip: a hash grid, then two layers."""
    sides = field["side"] * np.asarray(field.get("aspect", (1.0, 1.0, 1.0)))
    unit = (positions.astype(np.float64) - field["bounds_min"]) / sides
    table = arrays["field.tables.0" if field.get("is_shared") else f"field.tables.{knot}"]  # [levels, entries, values]
    levels, mask = [], field["n_entries"] - 1
    strides = field.get("strides") or [1] * len(field["cells"])
    for level, (n_cells, stride) in enumerate(zip(field["cells"], strides, strict=True)):
        scaled = np.clip(unit, 0, 1) * n_cells
        corner = np.minimum(scaled.astype(np.int64), n_cells - 1)
        fraction, side = scaled - corner, n_cells + 1
        key = 0
        if field.get("is_shared"):  # all frames share a table: the frame's entries lie beside others', or are hashed
            block = 1 << (side**3 - 1).bit_length()
            n_different = (field["n_knots"] - 1) // stride + 1
            key = knot // stride * (block if block * n_different <= field["n_entries"] else PRIMES[3]) & mask
        total = 0
        for bits in range(8):
            offset = np.array([bits & 1, bits >> 1 & 1, bits >> 2 & 1])
            x, y, z = (corner + offset).T.astype(np.uint64)
            if side**3 <= field["n_entries"]:
                index = x + np.uint64(side) * (y + np.uint64(side) * z)
            else:
                index = x * np.uint64(PRIMES[0]) ^ y * np.uint64(PRIMES[1]) ^ z * np.uint64(PRIMES[2])
            weight = np.where(offset, fraction, 1 - fraction).prod(1)
            total = total + weight[:, None] * table[level][(index & np.uint64(mask)).astype(np.int64) ^ key]
        levels.append(total)
    hidden = np.maximum(np.concatenate(levels, 1) @ arrays["field.hidden.weight"].T, 0)
    features = hidden @ arrays["field.out.weight"].T
    return np.maximum(features, 0) if field.get("is_rectified") else features


def decode(header, arrays, reference, frame_in_clip):
    """Gaussians of a frame: means, quats (wxyz), scales, opacities, colors."""
    sets, light = anchor_sets(header, arrays, reference)
    heads = arrays if any(name.startswith("decoder.") for name in arrays) else reference
    apart = [at for at in (arrays, heads) if any(name.startswith("moving_decoder.") for name in at)]
    k, parts = header["decoder"]["gaussians_per_anchor"], []
    for role, anchors in sets.items():
        rows = np.arange(len(anchors["positions"]))
        f_d = np.zeros((len(rows), header["decoder"]["dynamic_dim"]))
        if "presence" in anchors:
            rows = np.flatnonzero(anchors["presence"][:, frame_in_clip])
            f_d = dynamic_features(anchors["positions"][rows], header["field"], arrays, frame_in_clip)
        features = np.concatenate([anchors["features"][rows], f_d], 1)
        raw = {}
        at, name = (apart[0], "moving_decoder") if apart and "presence" in anchors else (heads, "decoder")
        for head in ("opacity", "color", "shape", "offset"):
            hidden = np.maximum(features @ at[f"{name}.first.{head}"] + at[f"{name}.first_bias.{head}"], 0)
            raw[head] = hidden @ at[f"{name}.second.{head}"] + at[f"{name}.second_bias.{head}"]
        n, shape = len(rows), raw["shape"].reshape(len(rows), k, 7)
        offsets = raw["offset"].reshape(n, k, 3) * np.exp(anchors["log_offset_scales"][rows])[:, None]
        colors = sigmoid(raw["color"].reshape(n, k, 3) + anchors["color_logits"][rows][:, None])
        if role == "static" and light is not None:
            weight = frame_in_clip / header["n_frames"]
            colors = colors * (np.exp(light) @ [1 - weight, weight])[:, None, None]
        positions = anchors["positions"][rows]
        if "velocities" in anchors:
            since = frame_in_clip - anchors["birth_frames"][rows][:, None]
            positions = positions + since * (anchors["velocities"][rows] + since * anchors["accelerations"][rows])
        part = (
            positions[:, None] + offsets,
            shape[..., 3:] / np.linalg.norm(shape[..., 3:], axis=-1, keepdims=True),
            np.exp(anchors["log_base_scales"][rows])[:, None] * sigmoid(shape[..., :3]),
            sigmoid(raw["opacity"].reshape(n, k, 1)),
            colors,
        )
        parts.append([array.reshape(n * k, -1) for array in part])
    columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    return dict(zip(("means", "quats", "scales", "opacities", "colors"), columns, strict=True))


def sigmoid(values):
    """The logistic function."""
    return 1 / (1 + np.exp(-values))


def clip_of(settings, frame=0, clip_index=None):
    """Index, name of the file and first frame of the clip that holds a frame, or that has an index."""
    length, bounds = settings["clip_length"], settings.get("clip_bounds")
    if bounds is None:  # every clip has as many frames
        clip_index = frame // length if clip_index is None else clip_index
        return clip_index, f"{clip_index:04d}", clip_index * length
    if clip_index is None:
        clip_index = max(i for i, start in enumerate(bounds[:-1]) if start <= frame)
    start, stop = bounds[clip_index], bounds[clip_index + 1]
    is_regular = start % length == 0 and stop == min(start + length, bounds[-1])
    return clip_index, f"{start // length:04d}" if is_regular else f"{start:06d}-{stop:06d}", start


def read_frame(project, frame):
    """Gaussians of a frame of a project."""
    project = Path(project)
    settings = json.loads((project / "project.json").read_text("utf-8"))["settings"]
    clip_index, name, start = clip_of(settings, frame=frame)
    header, arrays = read_clip(project / "clips" / f"{name}.safetensors")
    reference = {}  # a clip that inherits nothing needs none
    if header["role"] == "source":
        _, name, _ = clip_of(settings, clip_index=settings.get("reference_clip", 0))
        base, reference = read_clip(project / "clips" / f"{name}.safetensors")
        if base["fingerprint"] != header["reference_fingerprint"]:
            sys.exit(f"Clip {clip_index} was trained on another reference clip; train it again.")
    return decode(header, arrays, reference, frame - start)


if __name__ == "__main__":
    found = read_frame(sys.argv[1], int(sys.argv[2]))
    for name, array in found.items():
        print(f"{name:10} {array.shape}  {array.min():.4f} to {array.max():.4f}")
    if len(sys.argv) > 3:
        np.savez_compressed(sys.argv[3], **found)
