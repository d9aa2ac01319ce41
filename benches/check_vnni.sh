#!/bin/sh
# Counts the VNNI multiply-adds (vpdpwssd) in a binary and fails where there are too few: LLVM likes to rewrite them into
# vpmaddwd and vpaddd, which takes half as long again. Needs objdump (binutils), on x86-64.
#
#   cargo build --release && benches/check_vnni.sh            # target/release/hlacdb
#   benches/check_vnni.sh PATH                                # another binary
set -eu

binary=${1:-target/release/hlacdb}
# Two kernels of 250 masks have at least one for each.
expected=500

test -f "$binary" || { echo "no binary $binary: build it first (cargo build --release)" >&2; exit 2; }
found=$(objdump -d --no-show-raw-insn "$binary" | grep -c vpdpwssd || true)
if [ "$found" -lt "$expected" ]; then
    echo "$binary has $found vpdpwssd, expected $expected at least: the compiler has rewritten them" >&2
    exit 1
fi
echo "$binary has $found vpdpwssd"
