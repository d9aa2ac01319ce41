"""Texture describers of the literature beside ours: how well they find, and how long they take, on the same volumes.

    python3 -m venv peers-venv && peers-venv/bin/pip install -r benches/peers/requirements-likeness.txt
    cargo build --release && peers-venv/bin/python benches/peers/likeness.py [--json OUT.json]

Volumes: `hlacdb synth families`, clean and with `--nuisance all`, label `family`; and blocks of the real volumes of
../shared/data where they are there, label their source. Every volume asks for all others (leave one out): P@1, P@10, mAP.

Describers: Haralick's 13 features in 13 directions (mahotas), the co-occurrence of 8 grey levels in 13 directions, local
binary patterns of 8 neighbours on three orthogonal planes (LBP-TOP); the last two are ours, in numba. Each is taken

- untreated: z-scored, or whitened to 32 principal axes and scaled to unit length;
- with our treatment: directions pooled so that the 24 right-angle turns do not matter, and the fit of our spaces (points.py)
  on the scatter of the textures T, of their octants O and of nuisance copies N, weighted 0.2, 0.5 (as `default`) and 1 (as
  `invariant`). T and O are the store's own, as ours; N is of the pairs (clean, nuisances) of all families but that of the
  query. For real blocks N is that of all families, and T and O count the families as 300 textures, as our prior counts;
- the same of the volume stretched between its 1 and 99 percentiles (our view stretch@1), which takes care of contrast.

Ours is the program itself: the volumes are ingested, and `hlacdb eval --json` measures. Its prior was fitted on other
textures of the same families; what it does where the query's family is left out of everything, `cargo run --release
--example quality` tells, and --quality FILE adds what it printed. Times are of one thread: describing only for the
others, octants included where the treatment needs them; for ours reading, describing eight views with octants and
committing. Descriptions are kept in --work, so that a second run only measures.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import csv
import gzip
import hashlib
import itertools
import json
import pathlib
import re
import shutil
import subprocess
import sys
import time

import numba
import numpy as np

from points import mixed, points

ROOT = pathlib.Path(__file__).resolve().parents[2]
DATA = ROOT / "../shared/data"
SPACES = ["paper", "zscore", "oriented", "default", "invariant"]
K, DIMS, PRIOR_WEIGHT, MOST_BLOCKS = 10, 32, 300, 64

# One direction of each pair of opposites, and by how many axes it leads: 3 along axes, 6 along faces, 4 through the body.
DIRECTIONS = [d for d in itertools.product([-1, 0, 1], repeat=3) if d > (0, 0, 0)]
LEADS = np.array([np.count_nonzero(d) for d in DIRECTIONS])


# ---- describers: a volume to (directions or planes, features), and their pooling ----

def haralick(volume):
    import mahotas

    try:
        return mahotas.features.haralick(volume)
    except ValueError:  # a volume of one level has no co-occurrence to speak of
        return np.zeros((13, 13))


@numba.njit(cache=True)
def count_pairs(levels, directions):
    counts = np.zeros((len(directions), 8, 8))
    depth, height, width = levels.shape
    for d in range(len(directions)):
        dz, dy, dx = directions[d]
        for z in range(max(0, -dz), min(depth, depth - dz)):
            for y in range(max(0, -dy), min(height, height - dy)):
                for x in range(max(0, -dx), min(width, width - dx)):
                    counts[d, levels[z, y, x], levels[z + dz, y + dy, x + dx]] += 1
    return counts


UPPER = np.triu_indices(8)


def cooccurrence(volume):
    counts = count_pairs(volume >> 5, np.array(DIRECTIONS))
    counts += counts.transpose(0, 2, 1)
    return (counts / counts.sum((1, 2), keepdims=True))[:, UPPER[0], UPPER[1]]


@numba.njit(cache=True)
def count_patterns(volume):
    counts = np.zeros((3, 256))
    depth, height, width = volume.shape
    for z in range(1, depth - 1):
        for y in range(1, height - 1):
            for x in range(1, width - 1):
                v = volume[z, y, x]
                for plane in range(3):
                    code = 0
                    for n in range(8):
                        a, b = RING[n]
                        if plane == 0:
                            other = volume[z, y + a, x + b]
                        elif plane == 1:
                            other = volume[z + a, y, x + b]
                        else:
                            other = volume[z + a, y + b, x]
                        code |= (other >= v) << n
                    counts[plane, code] += 1
    return counts


RING = np.array([(-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1)])


def symmetric_patterns():
    """For each code the number of its orbit under the eight symmetries of the square."""
    orbit = {}
    for code in range(256):
        bits = [code >> n & 1 for n in range(8)]
        same = [bits[turn:] + bits[:turn] for turn in range(0, 8, 2)]
        # Mirrored at the diagonal through the first corner of the ring.
        same += [[turned[-n % 8] for n in range(8)] for turned in same]
        orbit[code] = min(sum(bit << n for n, bit in enumerate(bits)) for bits in same)
    names = sorted(set(orbit.values()))
    return np.array([names.index(orbit[code]) for code in range(256)])


SQUARE = symmetric_patterns()


def uniform_patterns():
    """The 58 codes with at most two changes around the ring have a bin each, all others share one."""
    changes = [bin((code ^ (code >> 1 | (code & 1) << 7)) & 255).count("1") for code in range(256)]
    kept = [code for code in range(256) if changes[code] <= 2]
    return np.array([kept.index(code) if code in kept else len(kept) for code in range(256)])


UNIFORM = uniform_patterns()


def lbp_top(volume):
    counts = count_patterns(volume)
    return counts / counts.sum(1, keepdims=True)


def by_bins(frequencies, bins):
    found = np.zeros((*frequencies.shape[:-1], bins.max() + 1))
    for code, at in enumerate(bins):
        found[..., at] += frequencies[..., code]
    return found


def flat(parts):
    return parts.reshape(*parts.shape[:-2], -1)


def pool_directions(parts):
    """Mean and deviation over the directions that a turn may take into one another."""
    groups = [parts[..., LEADS == lead, :] for lead in (1, 2, 3)]
    return np.concatenate([f(group, axis=-2) for group in groups for f in (np.mean, np.std)], -1)


def pool_planes(frequencies):
    parts = by_bins(frequencies, SQUARE)
    return np.concatenate([parts.mean(-2), parts.std(-2)], -1)


DESCRIBERS = {
    "Haralick 13 x 13": (haralick, flat, pool_directions),
    "GLCM, 8 levels": (cooccurrence, flat, pool_directions),
    "LBP-TOP": (lbp_top, lambda parts: flat(by_bins(parts, UNIFORM)), pool_planes),
}


def stretch(volume):
    """Our view stretch@1, in integers."""
    reached = np.cumsum(np.bincount(volume.ravel(), minlength=256)) * 100
    low = int(np.argmax(reached >= volume.size))
    high = max(int(np.argmax(reached >= 99 * volume.size)), low + 1)
    levels = (510 * (np.arange(256) - low) + high - low) // (2 * (high - low))
    return np.clip(levels, 0, 255).astype(np.uint8)[volume]


def octants(volume):
    halves = [(slice(None, side // 2), slice(side // 2, None)) for side in volume.shape]
    return [np.ascontiguousarray(volume[part]) for part in itertools.product(*halves)]


# ---- volumes ----

def run(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], check=True, capture_output=True)
    return done.stdout


def families(program, work, recipe, nuisance):
    """Volumes and labels of a recipe, as files in a folder for each label."""
    folder = work / f"{pathlib.Path(recipe).stem}-{nuisance}"
    shutil.rmtree(folder, ignore_errors=True)
    run(program, "-q", "synth", recipe, "--nuisance", nuisance, "--out", folder, "--format", "npy")
    with open(folder / "textures.csv") as table:
        rows = list(csv.DictReader(table))
    for row in rows:
        place = folder / "by-label" / row["family"]
        place.mkdir(parents=True, exist_ok=True)
        row["file"] = (folder / row["file"]).rename(place / row["file"])
    return Set(folder.name, [np.load(row["file"]) for row in rows], [row["family"] for row in rows], folder / "by-label")


def real(work, side):
    """Blocks of the real volumes that are there; those of (nearly) one level are left out."""
    folder = work / f"real-{side}"
    shutil.rmtree(folder, ignore_errors=True)
    volumes, labels = [], []
    for name, read in SOURCES.items():
        if not (DATA / name).exists():
            continue
        volume, label = read(DATA / name), name.split(".")[0]
        corners = itertools.product(*[range(0, length - side + 1, side) for length in volume.shape])
        blocks = [volume[z : z + side, y : y + side, x : x + side] for z, y, x in corners]
        blocks = [block for block in blocks if np.bincount(block.ravel()).max() < 0.9 * block.size]
        # Evenly spread over the volume where there are many.
        blocks = [blocks[at] for at in np.unique(np.linspace(0, len(blocks) - 1, MOST_BLOCKS).astype(int))] if blocks else []
        (folder / label).mkdir(parents=True)
        for number, block in enumerate(blocks):
            volumes.append(np.ascontiguousarray(block))
            labels.append(label)
            np.save(folder / label / f"{number}.npy", volumes[-1])
    return Set(folder.name, volumes, labels, folder)


def levels(samples):
    """256 levels from the lowest to the highest sample, as `--intensity full`."""
    if samples.dtype == np.uint8:
        return samples
    samples = samples.astype(float)
    low, high = samples.min(), samples.max()
    return np.floor(255 * (samples - low) / (high - low) + 0.5).astype(np.uint8)


def read_tiff(path):
    from PIL import Image, ImageSequence

    return np.stack([np.array(page) for page in ImageSequence.Iterator(Image.open(path))])


def read_nifti(path):
    data = gzip.open(path).read()
    dims = np.frombuffer(data, "<i2", 8, 40)
    kind = {2: "u1", 4: "<i2", 8: "<i4", 16: "<f4", 512: "<u2"}[int(np.frombuffer(data, "<i2", 1, 70)[0])]
    start = int(np.frombuffer(data, "<f4", 1, 108)[0])
    shape = [int(side) for side in dims[1:4]][::-1]
    return levels(np.frombuffer(data, kind, int(np.prod(shape)), start).reshape(shape))


SOURCES = {
    "ketton_microct.tif": read_tiff,
    "iguana_ct.nii.gz": read_nifti,
    "head_mr_gd.nii.gz": read_nifti,
    "sandstone_generated_f32.npy": lambda path: levels(np.load(path)),
    "blue_noise_64_u32.raw": lambda path: levels(np.fromfile(path, "<u4", 64**3, offset=24).reshape(64, 64, 64)),
}


class Set:
    """Labelled volumes, and where they are as files: a folder for each label."""

    def __init__(self, name, volumes, labels, folder):
        self.name, self.volumes, self.labels, self.folder = name, volumes, np.array(labels), folder
        digest = hashlib.sha256()
        for volume in volumes:
            digest.update(volume.tobytes())
        self.key = digest.hexdigest()[:16]

    def described(self, describer, prepare, work):
        """(volumes, parts, features) of the volumes, (volumes, 8, parts, features) of their octants."""
        name = f"{self.key}-{describer.__name__}-{prepare.__name__ if prepare else 'plain'}.npz"
        kept = work / name
        if not kept.exists():
            volumes = [prepare(volume) for volume in self.volumes] if prepare else self.volumes
            whole = np.stack([describer(volume) for volume in volumes])
            parts = np.stack([[describer(octant) for octant in octants(volume)] for volume in volumes])
            np.savez(kept, whole=whole, parts=parts)
        with np.load(kept) as arrays:
            return arrays["whole"], arrays["parts"]


# ---- points and measures ----

def zscored(features):
    deviation = features.std(0)
    return (features - features.mean(0)) * np.where(deviation > 1e-9, 1 / np.maximum(deviation, 1e-9), 0)


def whitened(features):
    z = zscored(features)
    values, vectors = np.linalg.eigh(z.T @ z / len(z))
    order = [at for at in np.argsort(-values)[:DIMS] if values[at] > 1e-10 * values.max()]
    found = z @ vectors[:, order] / np.sqrt(values[order])
    return found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-12)


def scatters(features, parts):
    """Mean, T and O."""
    apart = parts - parts.mean(1, keepdims=True)
    within = np.einsum("toi,toj->ij", apart, apart) * 8 / 7 / (8 * len(features))
    return features.mean(0), np.cov(features.T, bias=True), within


def nuisance(clean, changed):
    difference = clean - changed
    return difference.T @ difference / 2 / len(clean)


class Score:
    """Measures of queries, added up."""

    def __init__(self):
        self.first, self.top, self.precision = [], [], []

    def ask(self, found, labels, queries):
        """`queries` ask for all others by L2 between points, the lower number first where they are equally far."""
        for query in queries:
            distances = np.linalg.norm(found - found[query], axis=1)
            order = np.argsort(distances, kind="stable")
            relevant = labels[order[order != query]] == labels[query]
            if relevant.any():
                ranks = np.flatnonzero(relevant) + 1
                self.first.append(relevant[0])
                self.top.append(relevant[:K].mean())
                self.precision.append(np.mean(np.arange(1, len(ranks) + 1) / ranks))

    def result(self):
        return {"p_at_1": np.mean(self.first), "p_at_10": np.mean(self.top), "map": np.mean(self.precision)}


def score(found, labels):
    measured = Score()
    measured.ask(found, labels, range(len(labels)))
    return measured.result()


def treated(own, known, weight):
    """Our treatment: `own` (labels, features, octants) of the store, `known` of clean and changed families."""
    labels, features, parts = own
    groups, clean, clean_parts, changed = known
    measured = Score()
    model = scatters(features, parts)
    if not set(labels) <= set(groups):
        prior = (*scatters(clean, clean_parts), nuisance(clean, changed))
        model = mixed((*model, None), prior, PRIOR_WEIGHT, len(features))[:3]
    for label in sorted(set(labels)):
        others = groups != label
        found = points(features, *model, nuisance(clean[others], changed[others]), weight)
        measured.ask(found, labels, np.flatnonzero(labels == label))
    return measured.result()


def peers(sets, clean, changed, work):
    """A row for each set, describer and treatment."""
    for name, (describer, plain, pooled) in DESCRIBERS.items():
        for prepare in (None, stretch):
            title = name + (", stretched" if prepare else "")
            pair = [[pooled(part) for part in which.described(describer, prepare, work)] for which in (clean, changed)]
            known = (clean.labels, pair[0][0], pair[0][1], pair[1][0])
            for which in sets:
                whole, parts = which.described(describer, prepare, work)
                row = {"set": which.name, "describer": title}
                yield {**row, "treatment": "z-score", **score(zscored(plain(whole)), which.labels)}
                yield {**row, "treatment": "PCA-whitened", **score(whitened(plain(whole)), which.labels)}
                own = (which.labels, pooled(whole), pooled(parts))
                for weight in (0.2, 0.5, 1.0):
                    yield {**row, "treatment": f"ours, nuisance {weight:g}", **treated(own, known, weight)}


def ours(program, which, work):
    """What the program itself measures on the same files."""
    store = work / f"{which.name}.hlacdb"
    store.unlink(missing_ok=True)
    for folder in sorted(which.folder.iterdir()):
        run(program, "-q", "-s", store, "ingest", folder, "--tag", f"label={folder.name}", "--volumes", "none")
    run(program, "-q", "-s", store, "reindex")
    answer = run(program, "-q", "-s", store, "--json", "eval", "--label", "label", "-k", K, "--space", ",".join(SPACES))
    for space in json.loads(answer)["spaces"]:
        yield {"set": which.name, "describer": "hlacdb", "treatment": space["space"], "p_at_1": space["p_at_1"],
               "p_at_10": space["p_at_k"], "map": space["map"]}


def left_out(path, recipe):
    """What examples/quality.rs printed of spaces fitted without the query's family: mAP / P@1 / P@30."""
    printed = re.search(rf"^{re.escape(recipe)}: .*?\n\n?(.*?)(?=\n\n|\Z)", path.read_text(), re.S | re.M)
    for line in printed.group(1).splitlines() if printed else []:
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 5 and cells[0] in SPACES and "/" in cells[2]:
            for name, cell in ((f"{recipe}-none", cells[2]), (f"{recipe}-all", cells[3])):
                precision, first, _ = map(float, cell.split("/"))
                yield {"set": name, "describer": "hlacdb, family left out", "treatment": f"{cells[0]}, {cells[1]}",
                       "p_at_1": first, "p_at_10": None, "map": precision}


# ---- time ----

def least(calls, repeats=3):
    """The least milliseconds of a call, the mean over the calls."""
    spent = []
    for call in calls:
        times = []
        for _ in range(repeats):
            begin = time.perf_counter()
            call()
            times.append(time.perf_counter() - begin)
        spent.append(min(times))
    return 1000 * sum(spent) / len(spent)


def times(program, which, work):
    """Milliseconds a volume, on one thread: alone, and with octants."""
    step = max(1, len(which.volumes) // 24)
    chosen = which.volumes[::step]
    found = {}
    for name, (describer, _, _) in DESCRIBERS.items():
        describer(chosen[0])
        whole = least([lambda v=v: describer(v) for v in chosen])
        parts = least([lambda v=v: [describer(octant) for octant in octants(v)] for v in chosen])
        found[name] = {"ms": whole, "ms_with_octants": whole + parts}
    files = [path for folder in sorted(which.folder.iterdir()) for path in sorted(folder.iterdir())]
    answer = json.loads(run(program, "--json", "-q", "extract", *files))
    found["hlacdb, 251 sums"] = {"ms_with_octants": float(np.mean([file["elapsed_us"] for file in answer["files"]])) / 1000}
    store, spent = work / "time.hlacdb", []
    for _ in range(3):
        store.unlink(missing_ok=True)
        begin = time.perf_counter()
        run(program, "-q", "-s", store, "ingest", "--jobs", 1, "--volumes", "none", which.folder)
        spent.append(time.perf_counter() - begin)
    found["hlacdb, eight views, read and stored"] = {"ms_with_octants": 1000 * min(spent) / len(files)}
    return found


def table(rows, sets, spent):
    """Rows by describer and treatment, a column group for each set."""
    titles = {}
    for row in rows:
        titles.setdefault((row["describer"], row["treatment"]), {})[row["set"]] = row
    number = lambda value: "-" if value is None else f"{value:.3f}".lstrip("0")
    print("| describer | treatment | " + " | ".join(f"{which.name}: P@1, P@10, mAP" for which in sets) + " |")
    print("|---|---|" + "---|" * len(sets))
    for (describer, treatment), by_set in titles.items():
        cells = []
        for which in sets:
            row = by_set.get(which.name)
            cells.append(" ".join(number(row[key]) for key in ("p_at_1", "p_at_10", "map")) if row else "-")
        print(f"| {describer} | {treatment} | " + " | ".join(cells) + " |")
    print("\n| one thread, ms a volume | volume | volume and octants |\n|---|---|---|")
    for name, time_ in spent.items():
        alone = f"{time_['ms']:.2f}" if "ms" in time_ else "-"
        print(f"| {name} | {alone} | {time_['ms_with_octants']:.2f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recipe", default="families", help="a built-in recipe or a TOML file")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target/peers-likeness", help="files and descriptions")
    parser.add_argument("--hlacdb", default=str(ROOT / "target/release/hlacdb"), help="our program")
    parser.add_argument("--quality", type=pathlib.Path, help="what `cargo run --release --example quality` printed")
    parser.add_argument("--sides", default="64,48,32", help="of the real blocks")
    parser.add_argument("--json", type=pathlib.Path, help="write all rows here")
    arguments = parser.parse_args()
    program, work = arguments.hlacdb, arguments.work
    work.mkdir(parents=True, exist_ok=True)
    clean, changed = (families(program, work, arguments.recipe, words) for words in ("none", "all"))
    blocks = [real(work, int(side)) for side in arguments.sides.split(",")] if DATA.exists() else []
    sets = [clean, changed] + [which for which in blocks if len(set(which.labels)) > 1]
    for which in sets:
        print(f"{which.name}: {len(which.volumes)} volumes of {len(set(which.labels))} labels", file=sys.stderr)
    rows = [row for which in sets for row in ours(program, which, work)]
    if arguments.quality:
        rows += left_out(arguments.quality, pathlib.Path(arguments.recipe).stem)
    rows += peers(sets, clean, changed, work)
    spent = times(program, clean, work)
    table(rows, sets, spent)
    if arguments.json:
        shapes = {which.name: {"volumes": len(which.volumes), "labels": len(set(which.labels))} for which in sets}
        document = {"sets": shapes, "rows": rows, "milliseconds": spent}
        arguments.json.write_text(json.dumps(document, indent=1, default=float) + "\n")


if __name__ == "__main__":
    main()
