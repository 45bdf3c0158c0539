# shellcheck shell=bash
# Sourced after scratch_folder.sh: runs the command lines of pages, each once, with test pictures instead of
# cameras and without windows.
ball="videotestsrc pattern=ball num-buffers=40 ! video/x-raw,format=I420,framerate=25/1"
grey="filesrc location=camera.grey blocksize=$((4096 * 391)) ! video/x-raw,format=GRAY8,width=4096,height=391,framerate=0/1"
count=0 # of the lines so far
servers=()
trap 'kill "${servers[@]}" 2>/dev/null || true; rm -rf "$work"' EXIT

# rtspsrc interrupts its PAUSE with TEARDOWN when a pipeline stops, and may then send PAUSE to a server that
# has closed the connection: an error after the last frame.
ended_before_pause() {
  grep -q '^Got EOS' "$1" && ! sed '/^Got EOS/q' "$1" | grep -q ERROR && grep -q 'Could not send message' "$1"
}

run_lines() { # PAGE...
  local line port receiver= served=
  while IFS= read -r line; do
    line=${line//v4l2src device=\/dev\/video0 ! video\/x-raw,format=GRAY8,width=4096,height=391/$grey}
    line=${line//filesrc location=\/dev\/ttyACM0/filesrc location=camera.evt2}
    line=${line//tcpclientsrc host=camera port=3333 do-timestamp=true/filesrc location=camera.evt3}
    line=${line//v4l2src/$ball}
    line=${line//ximagesrc use-damage=false ! video\/x-raw,framerate=60\/1/$ball}
    line=${line//rtspsrc location=rtsp:\/\/camera\/stream ! decodebin/$ball}
    line=$(sed -E 's/num-buffers=(90|100|300)/num-buffers=40/g; s/(videotestsrc pattern=ball) (!|foreground)/\1 num-buffers=40 \2/' <<<"$line")
    line=${line//autovideosink/fakesink}
    line=${line//nvh264dec/avdec_h264 ! glupload} # no hardware decoder
    line=${line//vah264dec ! vapostproc ! \'video\/x-raw(memory:DMABuf)\'/avdec_h264}
    line=${line//glimagesink/"'video/x-raw(memory:GLMemory)' ! fakesink"}
    line=${line// --device \/dev\/video0/ --port 0}
    line=${line//host=receiver/host=127.0.0.1}
    line=${line// --profile slurm/}
    line=${line//server:8554/127.0.0.1:${served:-}}
    case $line in
      *glupload*) line=${line/num-buffers=40/num-buffers=5} ;; # the renderer may be in software
      *rtspsrc*) line=${line/fakesink/fakesink num-buffers=10} ;;
      gst-play*) line="$line --no-interactive --videosink=fakesink" ;;
      *--speed\ 0.01*) line=${line/--speed 0.01/--speed 0.1} ;; # 4,600 pictures take minutes on a busy machine
      *--from=10\ --to=20*) line=${line/--from=10 --to=20/--from=0.1 --to=0.2} ;;
      event-calibrate*) # a second, and a few properties to search, are enough
        line=${line/--to 2 --measure-from 2 --measure-to 10/--to 0.3 --measure-from 0.3 --measure-to 1}
        line=${line/--profile camera.profile/--profile camera.profile --to 0.3}
        line="${line/--element eventsim-dvs/} --element \"eventsim-dvs response=log log-eps=0.02 upsampling=linear denoise=0 adaptation=0 refractory-period=0\""
        ;;
    esac
    echo "$line"
    count=$((count + 1))
    case $line in *train_on_events* | *calibrate_camera*) continue ;; esac # have tests of their own
    if [[ $line =~ ^(web|rtsp)-events\  ]]; then # serves the lines that follow
      : >serving
      eval "exec $line" >>serving 2>&1 </dev/null &
      servers+=($!)
      served=
      for _ in $(seq 300); do
        served=$(sed -n 's#.*://[^/]*:\([0-9]*\)/.*#\1#p' serving)
        [ -n "$served" ] && break
        sleep 0.2
      done
      [ -n "$served" ] || fail "$(cat serving)"
      continue
    fi
    if [[ $line == *udpsrc* ]]; then # a receiver of what the next line sends
      eval "timeout 120 ${line/udpsrc/udpsrc num-buffers=5}" >received 2>&1 </dev/null &
      receiver=$!
      port=$(sed 's/.*udpsrc port=\([0-9]*\).*/\1/' <<<"$line")
      while kill -0 $receiver && ! grep -q "$(printf ':%04X ' "$port")" /proc/net/udp; do sleep 0.1; done
      continue
    fi
    timeout --verbose 120 bash -c "$line" >output 2>&1 </dev/null || ended_before_pause output || fail "$(cat output)"
    if [ -n "$receiver" ]; then
      wait $receiver || fail "$(cat received)"
      receiver=
    fi
  done < <(awk '/^```/ { open = !open; inside = open && $0 == "```" } inside && !seen[$0]++ && /^(gst-|ges-|event-|web-|rtsp-|\.\/pipelines\/(events_|examples\/|voxel_)|for |\{ |\/usr\/bin\/python3 )/' "$@")
  for server in "${servers[@]}"; do
    kill "$server"
    wait "$server" || fail "a server ended with status $?"
  done
  servers=()
}
