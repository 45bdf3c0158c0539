# SPDX-License-Identifier: LGPL-2.1-or-later
# shellcheck shell=bash
# Files that filters of pixels read.

# A mask and a calibration of a sensor of 320x240 pixels: FOLDER/mask.png, which leaves out the left half,
# and FOLDER/camera.yaml.
make_pixel_files() { # FOLDER
  "$GST_LAUNCH" -q videotestsrc pattern=white num-buffers=1 ! video/x-raw,width=160,height=240 ! \
    videobox left=-160 ! video/x-raw,format=GRAY8 ! pngenc ! filesink location="$1/mask.png"
  cat >"$1/camera.yaml" <<CALIBRATION
%YAML:1.0
---
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 300., 0., 160., 0., 300., 120., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.2, 0.05, 0., 0., 0. ]
CALIBRATION
}
