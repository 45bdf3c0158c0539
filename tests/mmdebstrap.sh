#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs mmdebstrap with what the host's apt knows of Debian's mirror: its address, its proxy, and
# whether it may be an old snapshot. An archive goes to standard output.
#   tests/mmdebstrap.sh SUITE [OPTION...]     "host" is the host's own release, with its updates
# Exits with status 77 if the mirror does not have the release.
set -euo pipefail
suite=$1
shift

mirror() { # FORMAT FILTER...
  apt-get indextargets --format "$@" 'Created-By: Packages' 'Origin: Debian' | sort -u
}
if [ "$suite" = host ]; then
  suite=$(sed -n 's/^VERSION_CODENAME=//p' /etc/os-release)
  mapfile -t sources < <(mirror 'deb $(REPO_URI) $(RELEASE) $(COMPONENT)')
else
  address=$(mirror '$(REPO_URI)' 'Label: Debian' | head -n 1)
  address=${address:-http://deb.debian.org/debian/}
  scratch=$(mktemp -d)
  trap 'rm -rf "$scratch"' EXIT
  answer=$(/usr/lib/apt/apt-helper download-file "${address}dists/$suite/InRelease" "$scratch/InRelease" 2>&1) || true
  if [[ $answer == *' 404 '* ]]; then
    echo "The mirror $address offers no Debian $suite" >&2
    exit 77
  fi
  sources=("deb $address $suite main")
fi
mapfile -t options < <(apt-config dump --format='--aptopt=%F "%v";%n' Acquire | grep -E 'Check-|Proxy')
mmdebstrap --quiet "${options[@]}" "$@" "$suite" - "${sources[@]}"
