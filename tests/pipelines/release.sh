#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The release script sets the version everywhere, tags it, and builds a source package.
set -eu
if ! git -C "$SOURCE" rev-parse -q --verify HEAD >/dev/null 2>&1; then
  echo "$SOURCE is not a git repository"
  exit 77
fi
source "$SOURCE/tests/pipelines/scratch_folder.sh"
export GIT_CONFIG_GLOBAL=$work/git.config GIT_CONFIG_SYSTEM=/dev/null
git config --global safe.directory "*"
export GIT_AUTHOR_NAME=Test GIT_AUTHOR_EMAIL=test@localhost GIT_COMMITTER_NAME=Test GIT_COMMITTER_EMAIL=test@localhost
git clone -q "$SOURCE" clone
cp "$SOURCE/release" clone/
if [ -n "$(git -C clone status --porcelain)" ]; then git -C clone commit -q -a -m "As it is"; fi

version_of() { # CLONE
  meson introspect "$1/meson.build" --projectinfo | /usr/bin/python3 -c 'import json, sys; print(json.load(sys.stdin)["version"])'
}
version=$(version_of clone)
packaged=$(dpkg-parsechangelog -l clone/debian/changelog -S Version)
[ "$packaged" = "$version" ] || fail "the package is $packaged, the project $version"

refused() { # WORDS ARGUMENT...
  local words=$1
  shift
  if clone/release "$@" >out 2>&1; then fail "release $* succeeded"; fi
  grep -q -e "$words" out || fail "release $*: $(cat out)"
}
refused "release VERSION" next packages
touch clone/new
refused "has changes" 77.1.2 packages
rm clone/new

sed -i '/^## \[Unreleased\]/q' clone/CHANGELOG.md
git -C clone commit -q -a -m "No entries"
refused "no entries" 77.1.2 packages
printf '\n### Fixed\n\n- Something.\n' >>clone/CHANGELOG.md
git -C clone commit -q -a -m "An entry"

clone/release 77.1.2 packages >out 2>&1 || fail "$(cat out)"
[ "$(version_of clone)" = 77.1.2 ] || fail "the project is $(version_of clone)"
[ "$(dpkg-parsechangelog -l clone/debian/changelog -S Version)" = 77.1.2 ] || fail "debian/changelog is not of 77.1.2"
grep -q '^## \[77.1.2\] - 20' clone/CHANGELOG.md || fail "CHANGELOG.md has no 77.1.2"
[ -z "$(git -C clone status --porcelain)" ] || fail "changes are left: $(git -C clone status --porcelain)"
[ "$(git -C clone rev-parse 'v77.1.2^{commit}')" = "$(git -C clone rev-parse HEAD)" ] || fail "the tag is elsewhere"
dpkg-source -x packages/gst-eventsim_77.1.2.dsc unpacked >/dev/null
diff -r --exclude=.git clone unpacked || fail "the source package has other files"
refused "tag v77.1.2 exists" 77.1.2 packages
