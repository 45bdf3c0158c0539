#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Trains a small autoencoder on voxel grids that are made on the fly: train_on_events.py RECORDING...

Each worker reads its own recordings and shares nothing with the others. Debian: python3-torch
python3-gst-eventcamera"""
import sys

import gst_eventcamera as ec
import torch
from torch import nn
from torch.utils.data import DataLoader, IterableDataset, get_worker_info

BINS = 5


class VoxelGrids(IterableDataset):
    """The voxel grid of every 30 ms of the recordings: float32 of shape (BINS, height, width)."""

    def __init__(self, recordings):
        self.recordings = recordings

    def __iter__(self):
        worker = get_worker_info()  # None without workers
        for path in self.recordings[worker.id::worker.num_workers] if worker else self.recordings:
            for chunk in ec.stream(path, window=0.03):
                yield torch.from_numpy(ec.voxel_grid(chunk, BINS))


if __name__ == "__main__":
    recordings = sys.argv[1:]
    torch.manual_seed(1)
    # Processes that start afresh: GStreamer's threads do not survive a fork.
    grids = DataLoader(VoxelGrids(recordings), batch_size=8, num_workers=min(2, len(recordings)),
                       multiprocessing_context="spawn", persistent_workers=True)
    model = nn.Sequential(nn.Conv2d(BINS, 8, 3, stride=2, padding=1), nn.ReLU(),
                          nn.ConvTranspose2d(8, BINS, 4, stride=2, padding=1))
    optimizer = torch.optim.Adam(model.parameters(), lr=0.01)
    for epoch in range(3):
        total = count = 0
        for batch in grids:
            loss = nn.functional.mse_loss(model(batch), batch)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            total, count = total + loss.item() * len(batch), count + len(batch)
        print(f"epoch {epoch}: {count} grids, loss {total / count:.4f}")
