"""Nearest neighbours of the libraries that a user would pick instead, beside ours.

    python3 -m venv peers-venv && peers-venv/bin/pip install -r benches/peers/requirements-search.txt
    cargo build --release && peers-venv/bin/python benches/peers/search.py --csv search.csv --svg docs/search.svg

Everybody gets the same rows of 251 moments: real ones where `../shared/data/moments_20k.npy` is there, those of `hlacdb
synth families` elsewhere; larger sets lie between near rows, with noise of 1e-4 on the degree roots. One core each
(pin it: `taskset -c 1`), every system in a process of its own, so that peak memory is its own.

* Peers search the 251 moments themselves by L2. Rows marked (32) search the points of our `default` space, which is
  what ours searches: other vectors, so other neighbours.
* build: from an array in memory to an index on disk. Ours: from the array on disk to the store, statistics and fit included.
* cold: from the start of the process to the answer of one question; (load) leaves out what Python and imports take.
* warm: median and 95th percentile of one question, k = 10, asked one after another.
* a system that takes minutes to build or ask at a million rows stops at a hundred thousand.
* recall: the share of the true ten nearest. Ours, and every exact one, is compared with brute force over its own vectors.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS", "LANCE_CPU_THREADS",
                 "LANCE_IO_THREADS", "TOKIO_WORKER_THREADS"):
    os.environ[variable] = "1"

import argparse
import csv
import datetime
import json
import pathlib
import platform
import shutil
import subprocess
import sys
import tempfile
import time

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target/release/hlacdb"
K = 10
ORDERS = np.array([1] + [2] * 13 + [3] * 237)
SECONDS = 4.0  # so long is each system asked at most


# --- the rows -------------------------------------------------------------------------------------------------------

def sources(folder):
    """Real descriptors, or those of our own recipes."""
    shared = ROOT / "../shared/data/moments_20k.npy"
    if shared.exists():
        return np.load(shared).astype(np.float64), "moments_20k.npy"
    store = folder / "families.hlacdb"
    run("-q", "-s", store, "synth", "families")
    run("-q", "-s", store, "export", folder / "families")
    return np.load(folder / "families/moments.npy").astype(np.float64), "hlacdb synth families"


def make_rows(base, count, path, seed):
    """`count` rows between near rows of `base`, with noise on the degree roots."""
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(seed)
    roots = base ** (1 / ORDERS)
    centred = roots - roots.mean(0)
    axes = np.linalg.svd(centred[::4], full_matrices=False)[2][:12]
    near = cKDTree(centred @ axes.T).query(centred @ axes.T, k=9)[1]
    rows = np.lib.format.open_memmap(path, mode="w+", dtype=np.float32, shape=(count, 251))
    for first in range(0, count, 20_000):
        some = min(20_000, count - first)
        one = rng.integers(0, len(base), some)
        other = near[one, rng.integers(1, 9, some)]
        share = rng.random((some, 1))
        between = roots[one] * (1 - share) + roots[other] * share + rng.normal(0, 1e-4, (some, 251))
        rows[first:first + some] = np.clip(between, 0, 1) ** ORDERS
    rows.flush()


# --- ours -----------------------------------------------------------------------------------------------------------

def run(*arguments):
    done = subprocess.run([str(PROGRAM), *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"hlacdb {' '.join(map(str, arguments))}: {done.stderr}")
    return done


def child(code, *arguments):
    """Runs a part of this script in a process of its own; returns what it printed, seconds and its peak in MB."""
    return measured([sys.executable, __file__, "--child", code, *map(str, arguments)])


# A process inherits the peak of the one that started it: so a small one does, and times it as well.
LAUNCHER = """
import json, os, sys, time
began = time.perf_counter()
_, status, usage = os.wait4(os.posix_spawn(sys.argv[2], sys.argv[2:], os.environ), 0)
json.dump([time.perf_counter() - began, status, usage.ru_maxrss / 1024], open(sys.argv[1], "w"))
"""


def measured(command):
    """What a command printed, its seconds and its peak in MB."""
    with tempfile.NamedTemporaryFile("r") as figures:
        launcher = [sys.executable, "-S", "-c", LAUNCHER, figures.name, *map(str, command)]
        done = subprocess.run(launcher, capture_output=True, text=True)
        seconds, status, peak = json.load(open(figures.name))
    if status != 0:
        raise RuntimeError(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"status {status}")
    return done.stdout, done.stderr, seconds, peak


def ours(folder, count, questions, stored):
    store = folder / f"ours-{count}.hlacdb"
    store.unlink(missing_ok=True)
    rows = folder / f"rows-{count}.npy"
    _, _, imported, peak_import = measured([PROGRAM, "-q", "-s", store, "import", rows])
    _, _, fitted, _ = measured([PROGRAM, "-q", "-s", store, "reindex"])
    run("-q", "-s", store, "export", folder / f"points-{count}")
    points = np.load(folder / f"points-{count}/points.npy")
    np.save(folder / "one.npy", np.load(questions)[0])
    cold = ["-s", store, "--json", "query", "--moments", folder / "one.npy", "-k", K]
    measured([PROGRAM, *cold])
    runs = [measured([PROGRAM, *cold]) for _ in range(5)]
    results = []
    for index in ("kdtree", "linear"):
        out, log, _, peak = measured(
            [PROGRAM, "-vv", "-s", store, "--json", "query", "--moments", questions, "-k", K, "--index", index])
        times = [answer["elapsed_us"] for answer in json.loads(out)["queries"]]
        tree = [line for line in log.splitlines() if "built a tree" in line]
        built = float(tree[-1].split("ms=")[1].split()[0]) / 1000 if tree else 0.0
        # Stored rows have known points: their answers are compared with brute force, ids and all.
        out = run("-s", store, "--json", "query", "--moments", stored, "-k", K, "--index", index).stdout
        answers = [[hit["id"] for hit in answer["hits"]] for answer in json.loads(out)["queries"]]
        expected = [exact(points, points[row], K) + 1 for row in range(len(answers))]
        recall = np.mean([len(set(a) & set(e)) / K for a, e in zip(answers, expected)])
        results.append(dict(
            system=f"hlacdb {index}", rows=count, build_s=imported + fitted + built, index_s=built,
            file_mb=store.stat().st_size / 1e6, cold_ms=min(r[2] for r in runs) * 1e3,
            load_ms=min(r[2] for r in runs) * 1e3, cold_mb=max(r[3] for r in runs),
            median_us=float(np.median(times)), p95_us=float(np.percentile(times, 95)), recall=float(recall),
            peak_mb=max(peak, peak_import)))
    return results


def exact(vectors, question, k):
    """The rows of the k nearest, ties by row."""
    distance = ((vectors.astype(np.float64) - question.astype(np.float64)) ** 2).sum(1)
    some = np.argpartition(distance, min(k, len(distance) - 1))[:k + 1] if len(distance) > k else np.arange(len(distance))
    return some[np.lexsort((some, distance[some]))][:k]


# --- the others: build(vectors, path) -> index; load(path, dims) -> index; ask(index, vector) -> rows ------------------

class FaissFlat:
    name = "FAISS flat"

    def build(self, vectors, path):
        import faiss

        faiss.omp_set_num_threads(1)
        index = self.make(faiss, vectors.shape[1])
        index.add(vectors)
        faiss.write_index(index, str(path))
        return index

    def make(self, faiss, dims):
        return faiss.IndexFlatL2(dims)

    def load(self, path, dims):
        import faiss

        faiss.omp_set_num_threads(1)
        return lambda: faiss.read_index(str(path))

    def ask(self, index, vector):
        return index.search(vector[None], K)[1][0]


class FaissHnsw(FaissFlat):
    name = "FAISS HNSW ef 64"
    largest = 100_000

    def make(self, faiss, dims):
        index = faiss.IndexHNSWFlat(dims, 16)
        index.hnsw.efSearch = 64
        return index


class Hnswlib:
    name = "hnswlib ef 50"
    largest = 100_000

    def build(self, vectors, path):
        import hnswlib

        index = hnswlib.Index("l2", vectors.shape[1])
        index.init_index(len(vectors), M=16, ef_construction=200)
        index.set_num_threads(1)
        index.add_items(vectors)
        index.save_index(str(path))
        index.set_ef(50)
        return index

    def load(self, path, dims):
        import hnswlib

        def work():
            index = hnswlib.Index("l2", dims)
            index.load_index(str(path))
            index.set_num_threads(1)
            index.set_ef(50)
            return index

        return work

    def ask(self, index, vector):
        return index.knn_query(vector[None], K)[0][0]


class Usearch:
    name = "usearch exact"

    def build(self, vectors, path):
        from usearch.index import search

        np.save(path, vectors)
        self.search = search
        return vectors

    def load(self, path, dims):
        from usearch.index import search

        self.search = search
        return lambda: np.load(f"{path}.npy")

    def ask(self, index, vector):
        return self.search(index, vector, K, "l2sq", exact=True, threads=1).keys


class CKDTree:
    name = "scipy cKDTree"
    largest = 100_000

    def build(self, vectors, path):
        import pickle

        from scipy.spatial import cKDTree

        tree = cKDTree(vectors)
        path.write_bytes(pickle.dumps(tree))
        return tree

    def load(self, path, dims):
        import pickle

        import scipy.spatial  # noqa: F401

        return lambda: pickle.loads(path.read_bytes())

    def ask(self, index, vector):
        return index.query(vector, K)[1]


class LanceDb:
    name = "lancedb flat"
    largest = 100_000

    def build(self, vectors, path):
        import lancedb
        import pyarrow as pa

        shutil.rmtree(path, ignore_errors=True)
        flat = pa.FixedSizeListArray.from_arrays(pa.array(vectors.ravel()), vectors.shape[1])
        table = pa.table({"id": pa.array(np.arange(len(vectors))), "vector": flat})
        return lancedb.connect(str(path)).create_table("rows", table)

    def load(self, path, dims):
        import lancedb

        return lambda: lancedb.connect(str(path)).open_table("rows")

    def ask(self, index, vector):
        return index.search(vector).limit(K).to_arrow()["id"].to_numpy()


class SqliteVec:
    name = "sqlite-vec"
    largest = 100_000

    def connect(self, path):
        import apsw
        import sqlite_vec

        connection = apsw.Connection(str(path))
        connection.enable_load_extension(True)
        connection.load_extension(sqlite_vec.loadable_path())
        return connection

    def build(self, vectors, path):
        path.unlink(missing_ok=True)
        connection = self.connect(path)
        connection.execute(f"create virtual table rows using vec0(vector float[{vectors.shape[1]}])")
        with connection:
            connection.executemany("insert into rows(rowid, vector) values (?, ?)",
                                   ((row, vector.tobytes()) for row, vector in enumerate(vectors)))
        return connection

    def load(self, path, dims):
        import apsw  # noqa: F401
        import sqlite_vec  # noqa: F401

        return lambda: self.connect(path)

    def ask(self, index, vector):
        found = index.execute("select rowid from rows where vector match ? and k = ?", (vector.tobytes(), K))
        return np.array([row for row, in found])


PEERS = {"faiss-flat": FaissFlat, "faiss-hnsw": FaissHnsw, "hnswlib": Hnswlib, "usearch": Usearch, "ckdtree": CKDTree,
         "lancedb": LanceDb, "sqlite-vec": SqliteVec}


def peer_build(name, vectors, questions, path):
    """In a process of its own: build, then ask."""
    peer, path = PEERS[name](), pathlib.Path(path)
    vectors, questions = np.ascontiguousarray(np.load(vectors)), np.load(questions)
    began = time.perf_counter()
    index = peer.build(vectors, path)
    built = time.perf_counter() - began
    peer.ask(index, questions[0])
    times, answers, start = [], [], time.perf_counter()
    for question in questions:
        began = time.perf_counter()
        answer = peer.ask(index, question)
        times.append((time.perf_counter() - began) * 1e6)
        answers.append([int(row) for row in answer])
        if time.perf_counter() - start > SECONDS:
            break
    shown = min(len(answers), max(3, 2_000_000 // len(vectors)), 20)
    expected = [exact(vectors, question, K) for question in questions[:shown]]
    recall = float(np.mean([len(set(a) & set(map(int, e))) / K for a, e in zip(answers, expected)]))
    print(json.dumps(dict(build_s=built, median_us=float(np.median(times)), p95_us=float(np.percentile(times, 95)),
                          recall=recall, asked=len(times),
                          peak_mb=peak_of_this_process())))


def peak_of_this_process():
    return next(int(line.split()[1]) / 1024 for line in open("/proc/self/status") if line.startswith("VmHWM"))


def peer_cold(name, questions, path):
    """In a process of its own: load, one question."""
    peer, question = PEERS[name](), np.load(questions)[0]
    work = peer.load(pathlib.Path(path), len(question))
    began = time.perf_counter()
    peer.ask(work(), question)
    print(json.dumps(dict(load_ms=(time.perf_counter() - began) * 1e3)))


def size_of(path):
    path = pathlib.Path(path)
    files = [f for f in path.parent.glob(path.name + "*") if f.is_file()] + [f for f in path.rglob("*") if f.is_file()]
    return sum(f.stat().st_size for f in set(files)) / 1e6


def theirs(name, folder, count, vectors, questions, mark):
    path = folder / f"{name}{mark.strip(' ()')}-{count}"
    shown = PEERS[name].name + mark
    try:
        out, *_ = child("build", name, vectors, questions, path)
        result = dict(system=shown, rows=count, **json.loads(out.strip().splitlines()[-1]))
        child("cold", name, questions, path)
        colds = [child("cold", name, questions, path) for _ in range(3)]
        result.update(file_mb=size_of(path), index_s=result["build_s"], cold_ms=min(c[2] for c in colds) * 1e3,
                      load_ms=min(json.loads(c[0].strip().splitlines()[-1])["load_ms"] for c in colds),
                      cold_mb=max(c[3] for c in colds))
        return result
    except RuntimeError as error:
        print(f"{shown} at {count} rows: {error}", file=sys.stderr)
        return None
    finally:
        for left in folder.glob(path.name + "*"):
            shutil.rmtree(left) if left.is_dir() else left.unlink()


# --- the run --------------------------------------------------------------------------------------------------------

COLUMNS = ["rows", "system", "build_s", "index_s", "file_mb", "cold_ms", "load_ms", "cold_mb", "median_us", "p95_us",
           "recall", "peak_mb"]


def show(result):
    print(f"{result['rows']:>8} {result['system']:<22} {result['build_s']:>8.2f} {result['index_s']:>8.3f} "
          f"{result['file_mb']:>8.1f} {result['cold_ms']:>8.1f} {result['load_ms']:>8.1f} {result['cold_mb']:>7.0f} "
          f"{result['median_us']:>9.1f} {result['p95_us']:>9.1f} {result['recall']:>6.3f} {result['peak_mb']:>7.0f}",
          flush=True)


def machine():
    model = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), "")
    return f"one core of {model or platform.processor()}, {datetime.date.today().isoformat()}"


def plot(results, path, remark=""):
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "hlacdb", "font.size": 9, "svg.fonttype": "none"})
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(10, 4.4))
    for axis, column, title in ((axes[0], "median_us", "one warm question, median (µs)"),
                                (axes[1], "load_ms", "load and one question (ms); ours from process start")):
        for system in dict.fromkeys(r["system"] for r in results):
            some = [r for r in results if r["system"] == system]
            mine = system.startswith("hlacdb")
            axis.plot([r["rows"] for r in some], [r[column] for r in some], "o-" if mine else ".--", label=system,
                      linewidth=2.4 if mine else 1.0, zorder=3 if mine else 2)
        axis.set(xscale="log", yscale="log", xlabel="textures", title=title)
        axis.grid(alpha=0.3)
    axes[1].legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.suptitle(f"Exact and approximate 10 nearest neighbours; {machine()}{remark and '; '}{remark}", fontsize=8)
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None, "Title": "Time of a question against the number of textures"})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="600,10000,100000,1000000")
    parser.add_argument("--peers", default=",".join(PEERS))
    parser.add_argument("--questions", type=int, default=1000)
    parser.add_argument("--csv", type=pathlib.Path)
    parser.add_argument("--svg", type=pathlib.Path)
    parser.add_argument("--remark", default="", help="what the plot should say besides, e.g. that the machine was shared")
    parser.add_argument("--folder", type=pathlib.Path, help="where rows and indexes go; a temporary one unless said")
    parser.add_argument("--child", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        {"build": peer_build, "cold": peer_cold}[options.child[0]](*options.child[1:])
        return
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        base, origin = sources(folder)
        print(f"{machine()}; rows from {origin}; {subprocess.check_output([PROGRAM, '--version'], text=True).strip()}")
        print("    rows system                  build s  index s  file MB  cold ms  load ms cold MB  "
              "warm us    95 % us recall peak MB")
        results = []
        for count in map(int, options.sizes.split(",")):
            results += compare(folder, base, count, options)
            write(sorted(results, key=lambda result: result["rows"]), options)


def write(results, options):
    if options.csv:
        with open(options.csv, "w", newline="") as file:
            table = csv.writer(file)
            table.writerow(COLUMNS)
            table.writerows([[f"{r[c]:.4g}" if isinstance(r[c], float) else r[c] for c in COLUMNS] for r in results])
    if options.svg:
        plot(results, options.svg, options.remark)


def compare(folder, base, count, options):
    rows, questions, stored = folder / f"rows-{count}.npy", folder / "questions.npy", folder / "stored.npy"
    make_rows(base, count, rows, count)
    make_rows(base, options.questions, questions, 99)
    np.save(stored, np.load(rows, mmap_mode="r")[:max(10, min(100, 3_000_000 // count))])
    results = ours(folder, count, questions, stored)
    for result in results:
        show(result)
    points = folder / f"points-{count}/points.npy"
    np.save(folder / "asked-32.npy", np.load(points, mmap_mode="r")[:options.questions])
    for name in filter(None, options.peers.split(",")):
        if count > getattr(PEERS[name], "largest", count):
            continue
        wanted = [(rows, questions, "")]
        if name in ("faiss-flat", "hnswlib", "ckdtree"):
            wanted.append((points, folder / "asked-32.npy", " (32)"))
        for vectors, asked, mark in wanted:
            result = theirs(name, folder, count, vectors, asked, mark)
            if result:
                results.append(result)
                show(result)
    shutil.rmtree(folder / f"points-{count}", ignore_errors=True)
    for left in (rows, folder / f"ours-{count}.hlacdb"):
        left.unlink(missing_ok=True)
    return results


if __name__ == "__main__":
    main()
