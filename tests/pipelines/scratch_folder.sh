# shellcheck shell=bash
# Sourced by the tests of this folder: works in a temporary folder that is removed at the end.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

fail() {
  echo "FAILED: $*"
  exit 1
}
