#!/usr/bin/env bash
# Unpacks the C library of aarch64 Linux under target/platforms, for qemu to run programs with, and
# prints the folder. Installs nothing; does nothing that was done before.
set -euo pipefail
cd "$(dirname "$0")/../.."

root=$PWD/target/platforms/aarch64
if [ ! -e "$root/lib/ld-linux-aarch64.so.1" ]; then
    UNPACK_INTO=$root tools/platforms/toolchain.sh packages libc6:arm64 libgcc-s1:arm64 >&2
fi
echo "$root"
