#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# preset=davis346 generates about as many events from the frames of a DAVIS346 as that camera did, also in
# the part of the recording that it was not fitted to.
set -eu
recording=$SHARED_DATA/dark-cradle/davis346.aedat4
if [ ! -f "$recording" ]; then
  echo "$recording is missing"
  exit 77
fi
source "$SOURCE/tests/pipelines/scratch_folder.sh"

"$GST_LAUNCH" -q filesrc location="$recording" ! aedatdemux name=demux demux.video_0 ! queue ! eventsim-dvs preset=davis346 ! evtenc ! filesink location=simulated.raw
events() { # FILE
  "$BUILD/pipelines/event-convert" --from=0.16 --to=0.48 "$1" part.npz 2>&1 | sed -n 's/ events.*//p'
}
real=$(events "$recording")
simulated=$(events simulated.raw)
echo "$simulated events instead of $real"
[ $((4 * simulated)) -gt $((3 * real)) ] && [ $((4 * simulated)) -lt $((5 * real)) ] || fail "more than 25 % off"
