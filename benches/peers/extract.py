"""The exact 3-D HLAC sums in numpy, scipy, numba and torch, beside ours.

    python3 -m venv peers-venv && peers-venv/bin/pip install -r benches/peers/requirements-extract.txt
    cargo build --release && peers-venv/bin/python benches/peers/extract.py

Every formulation computes the same 251 integers of one random volume (64^3 unless --side says otherwise); the answers
are compared before any time is printed. One thread each; the best of some calls. Ours is the program itself: `hlacdb
extract --json` is given the volume many times, and the least of its "elapsed_us" counts (the sums alone, octants included,
without reading the file). torch is left out where it is not installed.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import itertools
import json
import pathlib
import re
import subprocess
import tempfile
import time

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]


def read_masks():
    """The masks as tuples of cells 9 z + 3 y + x, from the letters in the source: one place states them."""
    source = (ROOT / "crates/hlac/src/masks.rs").read_text()
    letters = re.search(r'const LETTERS: &str = "(.*?)";', source, re.S).group(1).replace("\\\n", " ")
    masks = [tuple(26 if c == "A" else ord(c) - ord("a") for c in word) for word in letters.split()]
    assert len(masks) == 251
    return masks


MASKS = read_masks()


def cover():
    """Pairs of cells such that every mask of three cells holds one: taken greedily, the most useful first."""
    left, pairs = {mask for mask in MASKS if len(mask) == 3}, []
    while left:
        uses = {}
        for mask in left:
            for pair in itertools.combinations(mask, 2):
                uses[pair] = uses.get(pair, 0) + 1
        pair = max(sorted(uses), key=uses.get)
        pairs.append(pair)
        left = {mask for mask in left if not set(pair) <= set(mask)}
    return pairs


PAIRS = cover()


def from_pairs(table, pair_sums, cell_sums):
    """The 251 sums from table[pair][third cell], the sums of the pairs and those of the cells."""
    sums = []
    for mask in MASKS:
        if len(mask) == 1:
            sums.append(cell_sums[mask[0]])
        elif mask in PAIRS:
            sums.append(pair_sums[PAIRS.index(mask)])
        elif len(mask) == 2:
            raise AssertionError(f"no pair {mask}")
        else:
            pair = next(pair for pair in PAIRS if set(pair) <= set(mask))
            sums.append(table[PAIRS.index(pair)][next(iter(set(mask) - set(pair)))])
    return [int(round(float(value))) for value in sums]


PAIRS += [mask for mask in MASKS if len(mask) == 2 and mask not in PAIRS]


def views(volume):
    """The 27 cells of all windows, as shifted views."""
    z, y, x = (side - 2 for side in volume.shape)
    return [volume[c // 9 : c // 9 + z, c // 3 % 3 : c // 3 % 3 + y, c % 3 : c % 3 + x] for c in range(27)]


def numpy_naive(volume):
    cells = views(volume.astype(np.uint32))
    sums = []
    for mask in MASKS:
        product = cells[mask[0]]
        for cell in mask[1:]:
            product = product * cells[cell]
        sums.append(int(product.sum(dtype=np.uint64)))
    return sums


def numpy_blas(volume):
    """Pairs times thirds as matrix products, plane by plane of windows to stay in the cache; exact in f64 below 2^53."""
    planes = views(volume.astype(np.float64))
    table, pair_sums, cell_sums = np.zeros((len(PAIRS), 27)), np.zeros(len(PAIRS)), np.zeros(27)
    for z in range(planes[0].shape[0]):
        cells = np.stack([view[z].ravel() for view in planes])
        pairs = np.stack([cells[a] * cells[b] for a, b in PAIRS])
        table += pairs @ cells.T
        pair_sums += pairs.sum(axis=1)
        cell_sums += cells.sum(axis=1)
    return from_pairs(table, pair_sums, cell_sums)


def scipy_fft():
    from scipy import fft

    def run(volume):
        """For each pair its correlation with the volume, by FFT: the shifts of 0 to 2 do not wrap around."""
        floats = volume.astype(np.float64)
        cells = views(floats)
        spectrum = fft.rfftn(floats)
        table, pair_sums = [], []
        for a, b in PAIRS:
            pair = cells[a] * cells[b]
            shifts = fft.irfftn(spectrum * fft.rfftn(pair, floats.shape).conj(), floats.shape)
            table.append(shifts[:3, :3, :3].ravel())
            pair_sums.append(pair.sum())
        return from_pairs(table, pair_sums, [cell.sum() for cell in cells])

    return run


def numba_rows():
    import numba

    order = np.array([len(mask) for mask in MASKS])
    cells = np.array([tuple(mask) + (0,) * (3 - len(mask)) for mask in MASKS])

    @numba.njit(cache=False)
    def row_sum(a, b, c, order):
        total = np.uint64(0)
        if order == 1:
            for x in range(a.size):
                total += np.uint64(a[x])
        elif order == 2:
            for x in range(a.size):
                total += np.uint64(np.uint32(a[x]) * np.uint32(b[x]))
        else:
            for x in range(a.size):
                total += np.uint64(np.uint32(a[x]) * np.uint32(b[x]) * np.uint32(c[x]))
        return total

    @numba.njit(cache=False)
    def sums(volume, order, cells):
        depth, height, width = volume.shape
        values = np.zeros(order.size, np.uint64)
        for z in range(depth - 2):
            for y in range(height - 2):
                for m in range(order.size):
                    a, b, c = cells[m]
                    values[m] += row_sum(
                        volume[z + a // 9, y + a // 3 % 3, a % 3 : a % 3 + width - 2],
                        volume[z + b // 9, y + b // 3 % 3, b % 3 : b % 3 + width - 2],
                        volume[z + c // 9, y + c // 3 % 3, c % 3 : c % 3 + width - 2],
                        order[m],
                    )
        return values

    return lambda volume: [int(value) for value in sums(volume, order, cells)]


def torch_gemm():
    import torch

    torch.set_num_threads(1)

    def run(volume):
        floats = torch.from_numpy(volume).to(torch.float64)
        cells = floats.unfold(0, 3, 1).unfold(1, 3, 1).unfold(2, 3, 1).reshape(-1, 27).T.contiguous()
        pairs = torch.stack([cells[a] * cells[b] for a, b in PAIRS])
        return from_pairs((pairs @ cells.T).numpy(), pairs.sum(dim=1).numpy(), cells.sum(dim=1).numpy())

    return run


def ours(program, volume, calls):
    """Sums and the least milliseconds of the program itself."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "volume.npy")
        np.save(path, volume)
        command = [program, "extract", "--json", *[path] * calls]
        environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
        done = subprocess.run(command, check=True, capture_output=True, env=environment)
    files = json.loads(done.stdout)["files"]
    return files[0]["sums"], min(file["elapsed_us"] for file in files) / 1000


def best(call, seconds):
    start, least = time.perf_counter(), float("inf")
    while True:
        before = time.perf_counter()
        call()
        least = min(least, time.perf_counter() - before)
        if time.perf_counter() - start > seconds:
            return least * 1000


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=int, default=64)
    parser.add_argument("--seconds", type=float, default=3, help="for each formulation")
    parser.add_argument("--hlacdb", default=str(ROOT / "target/release/hlacdb"), help="our program")
    arguments = parser.parse_args()
    volume = np.random.default_rng(1).integers(0, 256, [arguments.side] * 3, dtype=np.uint8)
    expected = numpy_naive(volume)
    rows = []
    makers = [
        ("numpy, mask by mask", lambda: numpy_naive),
        ("numpy, BLAS", lambda: numpy_blas),
        ("scipy, correlation by FFT", scipy_fft),
        ("numba, row loops", numba_rows),
        ("torch, unfold and gemm", torch_gemm),
    ]
    for name, make in makers:
        try:
            run = make()
        except ImportError as error:
            print(f"{name}: left out ({error})")
            continue
        assert run(volume) == expected, f"{name} differs"
        rows.append((name, best(lambda: run(volume), arguments.seconds)))
    try:
        sums, milliseconds = ours(arguments.hlacdb, volume, 400)
    except (OSError, subprocess.CalledProcessError, ValueError) as error:
        print(f"hlacdb: left out ({error}): cargo build --release makes it")
        milliseconds = min(time for _, time in rows)
    else:
        assert sums == expected, "hlacdb differs"
        rows.append(("hlacdb, octants included", milliseconds))
    print(f"answers: all equal. {arguments.side}^3, one thread, the best of calls for {arguments.seconds:g} s")
    for name, time_ in rows:
        print(f"{name:<28} {time_:10.3f} ms {time_ / milliseconds:10.1f} x")


if __name__ == "__main__":
    main()
