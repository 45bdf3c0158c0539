#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Events over RTP between three hosts: network namespaces joined by a bridge. Two receivers get
# every event that a third sends to a multicast group, with its time, in packets that fit the MTU.
# Skipped where namespaces are not permitted.
set -eu
source "$SOURCE/tests/pipelines/scratch_folder.sh"

id=ev$$
hosts=(a b c)
tear_down() {
  for host in "${hosts[@]}" bridge; do ip netns del $id$host 2>/dev/null || true; done
}
if ! { ip netns add ${id}bridge && ip -n ${id}bridge link add bridge type bridge; } 2>reason; then
  echo "Skipped, because network namespaces are not permitted here: $(cat reason)"
  tear_down
  exit 77
fi
trap 'tear_down; rm -rf "$work"' EXIT
ip -n ${id}bridge link set bridge up
number=1
for host in "${hosts[@]}"; do
  ip netns add $id$host
  ip -n $id$host link add wire type veth peer name $host netns ${id}bridge
  ip -n ${id}bridge link set dev $host master bridge up
  ip -n $id$host addr add 10.0.0.$((number++))/24 dev wire
  ip -n $id$host link set wire up
  ip -n $id$host route add 224.0.0.0/4 dev wire
done

on() { # HOST ARGUMENT...
  ip netns exec $id"$1" timeout 60 "$GST_LAUNCH" -q "${@:2}"
}

"$GST_LAUNCH" -q videotestsrc pattern=ball num-buffers=50 ! video/x-raw,width=320,height=240,framerate=25/1 ! eventsim-diff ! tee name=t  t. ! queue ! evtenc ! filesink location=sent.raw  t. ! queue ! eventcsvenc ! filesink location=sent.csv
lines=$(wc -l <sent.csv)
[ "$lines" -gt 10000 ] || fail "only $lines events to send"
caps=application/x-rtp,media=application,clock-rate=1000000,encoding-name=X-EVENT-CAMERA,width=320,height=240

for mtu in 576 1500 9000; do
  for host in "${hosts[@]}"; do
    ip -n $id$host link set wire mtu $mtu
    ip -n ${id}bridge link set dev $host mtu $mtu
  done
  receivers=()
  for host in b c; do
    rm -f received-$host.csv
    on $host udpsrc address=239.1.2.3 port=5000 buffer-size=1000000 caps=$caps ! rtpjitterbuffer ! rtpeventdepay ! eventcsvenc ! filesink buffer-mode=unbuffered location=received-$host.csv &
    receivers+=($!)
  done
  sleep 2
  # 28 bytes are the headers of IP and UDP.
  on a filesrc location=sent.raw ! evtdec ! rtpeventpay mtu=$((mtu - 28)) ! udpsink host=239.1.2.3 port=5000
  for host in b c; do
    for _ in $(seq 100); do
      [ "$(wc -l <received-$host.csv)" -ge "$lines" ] && break
      sleep 0.1
    done
    cmp sent.csv received-$host.csv || fail "host $host did not get what was sent, MTU $mtu"
  done
  for receiver in "${receivers[@]}"; do pkill -P "$receiver" || true; done
  wait "${receivers[@]}" || true
  # The column FragCreates of the kernel's counters.
  fragments=$(ip netns exec ${id}a awk '/^Ip:/ { if (column) print $column; else for (i = 1; i <= NF; ++i) if ($i == "FragCreates") column = i }' /proc/net/snmp)
  [ "$fragments" = 0 ] || fail "$fragments fragments of packets, MTU $mtu"
  echo "MTU $mtu: $lines events"
done
