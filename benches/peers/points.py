"""The recipe of the default space once more, in numpy and independently: are the points the same?

    cargo run --release --example points -- points-out
    cargo run --release -- masks > points-out/masks.txt       # or any list of the 251 masks by their letters, in order
    python benches/peers/points.py points-out points-out/masks.txt src/space/prior.bin PRIOR_WEIGHT

Needs numpy only (2.4.6: 3.0e-8 over 352 textures, the rounding to f32). Prints the largest difference of a coordinate for each of the three fits; exits 1 above 1e-6.
"""
import itertools
import re
import struct
import sys

import numpy as np

LETTERS = "abcdefghijklmnopqrstuvwxyzA"
RIDGE, LEAST, KEPT, DIMS, NUISANCE = 0.02, 1e-10, 128, 32, 0.5
FEATURES = 245


def cells(mask):
    return [np.array([i // 9, i // 3 % 3, i % 3]) for i in map(LETTERS.index, mask)]


def pattern(cells):
    return frozenset(map(tuple, np.array(cells) - np.min(cells, axis=0)))


def orbits(masks):
    """The masks of each orbit under the 48 symmetries of the cube, in the order of their first mask."""
    index = {pattern(cells(mask)): at for at, mask in enumerate(masks)}
    turns = [np.eye(3, dtype=int)[list(order)] * sign
             for order in itertools.permutations(range(3)) for sign in itertools.product([1, -1], repeat=3)]
    found = []
    for mask in masks:
        orbit = sorted({index[pattern([turn @ cell for cell in cells(mask)])] for turn in turns})
        if orbit not in found:
            found.append(orbit)
    return found


def pool(moments, masks):
    """(..., views, 251) moments to (..., views * 35) features."""
    roots = moments.astype(float) ** (1 / np.array([len(mask) for mask in masks]))
    found = orbits(masks)
    means = [roots[..., orbit].mean(-1) for orbit in found]
    deviations = [roots[..., orbit].std(-1) for orbit in found if len(orbit) > 1]
    features = np.stack(means + deviations, -1)
    return features.reshape(*features.shape[:-2], -1)


def shipped(path):
    """Mean and T, O, N of the prior."""
    data = open(path, "rb").read()
    assert data[:6] == b"hPri\x02\x00", "a prior of version 2"
    at = 6 + 16

    def numbers(kind, size):
        nonlocal at
        (length,) = struct.unpack_from("<I", data, at)
        values = np.frombuffer(data, kind, length, at + 4).astype(float)
        at += 4 + size * length
        return values

    def steps():
        """Whole numbers of one step, little-endian, of as many bytes as the widest needs."""
        nonlocal at
        step, length, width = struct.unpack_from("<dIB", data, at)
        at += 13
        whole = np.frombuffer(data, np.uint8, length * width, at).reshape(length, width).astype(np.int64)
        at += length * width
        values = (whole << 8 * np.arange(width)).sum(1)
        return np.where(values >= 1 << (8 * width - 1), values - (1 << 8 * width), values) * step

    mean, deviation = numbers("<f8", 8), numbers("<f8", 8)
    scatters = []
    for _ in range(3):
        root = np.zeros((len(mean), len(mean)))
        root[np.triu_indices(len(mean))] = steps()
        root += np.triu(root, 1).T
        scatters.append(root @ root * np.outer(deviation, deviation))
    # The prior knows full@1 too, whose features come first.
    kept = slice(len(mean) - FEATURES, None)
    return mean[kept], *(scatter[kept, kept] for scatter in scatters)


def observed(features, octants, copies):
    """Mean and T, O, N of textures."""
    apart = octants - octants.mean(1, keepdims=True)
    change = features - copies
    return (features.mean(0), np.cov(features.T, bias=True),
            np.einsum("toi,toj->ij", apart, apart) * 8 / 7 / (8 * len(features)), change.T @ change / 2 / len(features))


def points(features, mean, between, within, nuisance, weight=NUISANCE):
    deviation = np.sqrt(np.diag(between))
    scale = np.where(deviation > 1e-9, 1 / np.maximum(deviation, 1e-9), 0)
    between, within, nuisance = (matrix * np.outer(scale, scale) for matrix in (between, within, nuisance))
    values, vectors = np.linalg.eigh(between)
    keep = np.argsort(-values)[:KEPT]
    keep = keep[values[keep] > LEAST * values.max()]
    white = vectors[:, keep] / np.sqrt(values[keep])
    values, vectors = np.linalg.eigh(white.T @ (within + weight * nuisance) @ white)
    axes = white @ vectors[:, :DIMS] / np.sqrt(np.maximum(values[:DIMS], 0) + RIDGE)
    axes *= np.sign(axes[np.abs(axes).argmax(0), range(axes.shape[1])])
    found = (features - mean) * scale @ axes
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def mixed(own, prior, weight, count):
    share = count / (count + weight)
    apart = own[0] - prior[0]
    between = share * own[1] + (1 - share) * prior[1] + share * (1 - share) * np.outer(apart, apart)
    return prior[0] + share * apart, between, share * own[2] + (1 - share) * prior[2], prior[3]


def main(folder, masks, prior, weight):
    masks = [mask for mask in re.findall(r"\b[a-zA]{1,3}\b", open(masks).read())]
    assert len(masks) == 251 and len(orbits(masks)) == 18
    load = lambda name: np.load(f"{folder}/{name}.npy")
    features, octants, copies = (pool(load(name), masks) for name in ("moments", "octants", "copies"))
    own, known = observed(features, octants, copies), shipped(prior)
    models = {"own": own, "prior": known, "both": mixed(own, known, float(weight), len(features))}
    worst = 0
    for name, model in models.items():
        difference = np.abs(points(features, *model) - load(f"points_{name}")).max()
        worst = max(worst, difference)
        print(f"{name}: largest difference of a coordinate {difference:.1e} over {len(features)} textures")
    return int(worst > 1e-6)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
