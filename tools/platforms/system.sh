#!/usr/bin/env bash
# Unpacks the C library of a Debian architecture under target/platforms, for qemu to run programs
# with, and prints the folder. Installs nothing; does nothing that was done before:
#
#     tools/platforms/system.sh arm64
set -euo pipefail
cd "$(dirname "$0")/../.."

root=$PWD/target/platforms/$1
if [ ! -e "$root/complete" ]; then
    UNPACK_INTO=$root tools/platforms/toolchain.sh packages "libc6:$1" "libgcc-s1:$1" >&2
    touch "$root/complete"
fi
echo "$root"
