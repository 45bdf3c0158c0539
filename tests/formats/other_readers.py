#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Holds our tables of events against NumPy and h5py: what we write they read, what they write we
read. other_readers.py TABLE_FILES"""
import io
import pathlib
import resource
import subprocess
import sys
import tempfile
import unittest
import zipfile
import zlib

import h5py
import numpy as np

RAW = np.dtype({'names': ['t', 'x', 'y_p'], 'formats': ['<i8', '<u2', '<u2'],
                'offsets': [0, 8, 10], 'itemsize': 16})
TABLE_FILES = sys.argv.pop(1)
WIDTH, HEIGHT = 1280, 720


def random_events(count, seed, last=20_000_000, first=1_234_567):
    random = np.random.default_rng(seed)
    t = np.sort(random.integers(0, last, count)) + first
    if count > 0:
        t[count // 3:count // 2] = t[count // 3]  # a burst
    x = random.integers(0, WIDTH, count)
    y = np.where(random.random(count) < 0.7, 100, random.integers(0, HEIGHT, count))
    run = slice(count // 2, count * 3 // 4)
    x[run] = (np.arange(count)[run] * 2) % WIDTH
    return {'t': t, 'x': x, 'y': y, 'p': random.integers(0, 2, count)}


class TableTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.file = self.folder / 'table'

    def write(self, kind, events):
        raw = np.zeros(len(events['t']), RAW)
        raw['t'], raw['x'], raw['y_p'] = events['t'], events['x'], events['y'] | events['p'] << 15
        (self.folder / 'raw').write_bytes(raw.tobytes())
        subprocess.run([TABLE_FILES, 'write', kind, self.file, self.folder / 'raw'], check=True)

    def read(self, kind):
        out = subprocess.run([TABLE_FILES, 'read', kind, self.file, self.folder / 'raw'],
                             stdout=subprocess.PIPE, text=True)
        self.assertEqual(out.returncode, 0, out.stdout)
        raw = np.frombuffer((self.folder / 'raw').read_bytes(), RAW)
        return ({'t': raw['t'], 'x': raw['x'], 'y': raw['y_p'] & 0x7fff, 'p': raw['y_p'] >> 15},
                out.stdout.strip())

    def assert_equal(self, found, events):
        for name in 'txyp':
            np.testing.assert_array_equal(found[name], events[name], name)

    def assert_read(self, kind, events):
        found, corruption = self.read(kind)
        self.assertEqual(corruption, '0 0')
        self.assert_equal(found, events)

    def refused(self):
        """What is said of a file that cannot be read."""
        out = subprocess.run([TABLE_FILES, 'read', 'hdf5', self.file, self.folder / 'raw'],
                             stdout=subprocess.PIPE, text=True, timeout=60)
        self.assertEqual(out.returncode, 1, out.stdout)
        return out.stdout


class OtherReaders(TableTest):
    """What we write, others read, and the other way round."""

    def test_numpy_loads_our_files(self):
        for count in (0, 1, 100_000):
            events = random_events(count, 1)
            self.write('npy', events)
            array = np.load(self.file)
            self.assertEqual(array.dtype.names, ('x', 'y', 't', 'p'))
            self.assert_equal(array, events)
            self.write('npz', events)
            with zipfile.ZipFile(self.file) as archive:
                self.assertIsNone(archive.testzip())
            arrays = np.load(self.file)
            self.assertEqual({name: array.dtype for name, array in arrays.items()},
                             {'width': 'i8', 'height': 'i8', 't': 'i8', 'x': 'u2', 'y': 'u2', 'p': 'u1'})
            self.assertEqual((arrays['width'].shape, arrays['width'], arrays['height']), ((), WIDTH, HEIGHT))
            self.assert_equal(arrays, events)

    def test_we_load_numpys_npy(self):
        events = random_events(30_000, 2)
        for fields in ([('t', '<i8'), ('x', '<i2'), ('y', '<i2'), ('p', 'u1')],
                       [('x', '>u4'), ('y', '>i8'), ('p', '?'), ('t', '>u8')],
                       [('p', '<i4'), ('t', '<f8'), ('y', '<f4'), ('x', '<f8')],
                       [('timestamp', '<u4'), ('x', '<u2'), ('y', '<u2'), ('polarity', 'i1')],
                       [('x', '<f2'), ('extra', '<c16', (2, 3)), ('y', 'u2'), ('name', 'U5'), ('t', 'i8'), ('on', '?')]):
            for align in (False, True):
                dtype = np.dtype(fields, align=align)
                array = np.zeros(len(events['t']), dtype)
                expected = dict(events)
                for name, _ in [field[:2] for field in fields]:
                    key = {'timestamp': 't', 'polarity': 'p', 'on': 'p'}.get(name, name)
                    if key not in events:
                        continue
                    kind = dtype[name].kind
                    array[name] = events[key] / 1e6 if key == 't' and kind == 'f' else events[key]
                    if dtype[name] == np.dtype('<f2'):
                        expected[key] = array[name].astype(int)  # of 11 bits
                for version in ((1, 0), (2, 0), (3, 0)):
                    stream = io.BytesIO()
                    np.lib.format.write_array(stream, array, version=version)
                    self.file.write_bytes(stream.getvalue())
                    self.assert_read('npy', expected)

    def test_we_load_numpys_archives(self):
        events = random_events(30_000, 6)
        structured = np.zeros(30_000, [('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', 'u1')])
        for name in 'txyp':
            structured[name] = events[name]
        for save in (np.savez, np.savez_compressed):
            for arrays in ({**events, 'size': np.array([1280, 720])},
                           {'ts': events['t'] / 1e6, 'xs': events['x'], 'ys': events['y'], 'ps': events['p'] > 0},
                           {'t_ns': events['t'] * 1000, **{name: events[name].astype('u2') for name in 'xyp'}},
                           {'events': structured},
                           {'arr_0': np.stack([events[name] for name in 'xytp'], axis=1)}):
                with open(self.file, 'wb') as file:
                    save(file, **arrays)
                self.assert_read('npz', events)

    def test_numpy_reads_our_text(self):
        events = random_events(20_000, 3)
        for kind, names, delimiter, unit, skipped in (
                ('names', 'txyp', ',', 1, 1), ('metavision', 'xypt', ',', 1, 1),
                ('faery', 'txyp', ',', 1, 1), ('rpg', 'txyp', None, 1e6, 0),
                ('e2vid', 'txyp', None, 1e6, 1), ('esim', 'txyp', None, 1e-3, 0)):
            self.write(kind, events)
            table = np.loadtxt(self.file, delimiter=delimiter, skiprows=skipped)
            self.assert_equal({name: np.round(table[:, i] * (unit if name == 't' else 1)).astype(int)
                               for i, name in enumerate(names)}, events)

    def test_we_read_numpys_text(self):
        events = random_events(20_000, 4)
        table = np.stack([events[name] for name in 'txyp'], axis=1)
        seconds = table / [1e6, 1, 1, 1]
        # All of an array become floating-point numbers.
        for rows, options in ((seconds, {}), (seconds, {'fmt': '%.9f %d %d %d'}), (table, {}),
                              (table, {'fmt': '%d', 'delimiter': ', ', 'header': 't,x,y,p'})):
            np.savetxt(self.file, rows, **options)
            self.assert_read('csv', events)

    def check_dsec(self, file, events):
        t = file['events/t'][:].astype(np.int64)
        index = file['ms_to_idx'][:].astype(np.int64)
        offset = file['t_offset'][()]
        self.assert_equal({'t': t + offset, **{name: file['events/' + name][:] for name in 'xyp'}}, events)
        self.assertEqual(file['events/p'].dtype, np.uint8)
        self.assertEqual(file['events/x'].dtype, np.uint16)
        self.assertEqual(file['ms_to_idx'].dtype, np.uint64)
        self.assertEqual(file['t_offset'].shape, ())
        self.assertEqual(file['t_offset'].dtype, np.int64)
        # By definition: t[ms_to_idx[k]] >= 1000 k and t[ms_to_idx[k] - 1] < 1000 k.
        self.assertEqual(len(index), t[-1] // 1000 + 1)
        self.assertEqual(index[0], 0)
        k = np.arange(len(index))
        self.assertTrue((t[index] >= 1000 * k).all())
        inner = index > 0
        self.assertTrue((t[index[inner] - 1] < 1000 * k[inner]).all())

    def test_h5py_reads_our_dsec(self):
        hours = 3 * 3600 * 1_000_000
        for count, last in ((1, 1), (200_000, 20_000_000), (150_000, 40_000), (150_000, hours)):
            events = random_events(count, 5, last)
            for kind in ('dsec-none', 'dsec-gzip'):
                self.write(kind, events)
                with h5py.File(self.file) as file:
                    self.check_dsec(file, events)
                    self.assertEqual(file['events/t'].dtype, np.uint64 if last == hours else np.uint32)
                    self.assertEqual(file['events/t'].compression, 'gzip' if 'gzip' in kind else None)
                self.assert_read('hdf5', events)

    def test_we_read_h5pys_dsec(self):
        events = random_events(50_000, 7)
        offset = 1_000_000_000_000
        widths = ({'t': 'u4', 'x': 'u2', 'y': 'u2', 'p': 'u1'}, {'t': '>i8', 'x': '>i4', 'y': 'i8', 'p': '?'},
                  {'t': 'u8', 'x': 'i2', 'y': 'u4', 'p': 'i1'})
        for i, types in enumerate(widths):
            for j, options in enumerate(({}, {'chunks': (1,)}, {'chunks': (1000,), 'compression': 'gzip'},
                                         {'chunks': (777,), 'fletcher32': True},
                                         {'chunks': True, 'compression': 'gzip', 'shuffle': True, 'fletcher32': True},
                                         {'chunks': (1_000_000,), 'maxshape': (None,), 'compression': 'gzip'})):
                if options.get('chunks') == (1,) and i > 0:
                    continue
                with h5py.File(self.file, 'w', libver='latest' if j % 2 else 'earliest') as file:
                    for name in 'txyp':
                        file.create_dataset('events/' + name, data=events[name].astype(types[name]), **options)
                    file['t_offset'] = offset
                self.assert_read('hdf5', {**events, 't': events['t'] + offset})

    def test_we_read_v2es(self):
        events = random_events(50_000, 9)
        table = np.stack([events[name] for name in 'txyp'], axis=1)
        for kind, options in (('u4', {'compression': 'gzip', 'maxshape': (None, 4)}), ('i8', {}),
                              ('>u4', {'chunks': (100, 2)})):
            with h5py.File(self.file, 'w') as file:
                file.create_dataset('events', data=table.astype(kind), **options)
            self.assert_read('hdf5', events)

    def test_rows_of_fractions_are_refused(self):
        with h5py.File(self.file, 'w') as file:
            file['davis/left/events'] = np.full((10, 4), 1.5, 'f4')
        self.assertIn('fractional numbers', self.refused())

    def test_h5py_reads_the_layout_of_our_ecf(self):
        for seed, last in ((10, 20_000_000), (11, 3000), (12, 80 * 60 * 1_000_000)):  # of more than 32 bits
            events = random_events(60_000, seed, last)
            self.write('metavision-hdf5', events)
            with h5py.File(self.file) as file:
                dataset = file['CD/events']
                self.assertEqual(dataset.shape, (60_000,))
                self.assertEqual(dataset.chunks, (16384,))
                fields = dataset.dtype.fields
                self.assertEqual({name: (fields[name][0].str, fields[name][1]) for name in fields},
                                 {'x': ('<u2', 0), 'y': ('<u2', 2), 'p': ('<i2', 4), 't': ('<i8', 8)})
                self.assertEqual(dataset.dtype.itemsize, 16)
                self.assertEqual(dataset.id.get_create_plist().get_filter(0)[0], 0x8ECF)
                self.assertEqual(file['EXT_TRIGGER/events'].dtype.itemsize, 24)
                self.assertEqual(file.attrs['version'], '1.0')
                self.assertEqual(file.attrs['geometry'], '1280x720')
                self.check_index(file['CD/indexes'], events['t'])
            self.assert_read('hdf5', events)

    def check_index(self, indexes, t):
        first = int(t[0])
        self.assertEqual(indexes.attrs['offset'], str(-first))
        periods = (t - first) // 2000
        self.assertEqual(len(indexes), periods[-1] + 2)
        ids, times = indexes['id'], indexes['ts']
        self.assertEqual((ids[0], times[0]), (0, -1))
        # Entry k is the first event of the last period before k that has any.
        firsts = np.searchsorted(periods, periods[np.searchsorted(periods, np.arange(1, len(ids))) - 1])
        np.testing.assert_array_equal(ids[1:], firsts)
        np.testing.assert_array_equal(times[1:], t[firsts] - first)

    def test_metavision_without_ecf(self):
        events = random_events(40_000, 13)
        rows = np.zeros(40_000, [('x', '<u2'), ('y', '<u2'), ('p', '<i2'), ('t', '<i8')])
        for name in 'txyp':
            rows[name] = events[name]
        for options in ({}, {'compression': 'gzip', 'chunks': (5000,)}):
            with h5py.File(self.file, 'w') as file:
                file.create_dataset('CD/events', data=rows, **options)
            self.assert_read('hdf5', events)


class Corrupt(TableTest):
    """Files that claim what is not so: an error or a count, at once."""

    def with_columns(self, **changed):
        with h5py.File(self.file, 'w') as file:
            for name in 'txyp':
                make = changed.get(name)
                if make:
                    make(file, 'events/' + name)
                else:
                    file['events/' + name] = np.ones(10, 'u2')

    def test_shapes_and_types(self):
        for make in (lambda file, name: file.create_dataset(name, data=np.ones(10)),
                     lambda file, name: file.create_dataset(name, data=np.ones((10, 2), 'u2')),
                     lambda file, name: file.create_dataset(name, data=np.ones(10, 'S3')),
                     lambda file, name: file.create_dataset(name, shape=None, dtype='u2'),
                     lambda file, name: file.create_dataset(name, shape=(10,), dtype='u2', external=[('/etc/passwd', 0, 20)]),
                     lambda file, name: file.__setitem__(name, h5py.ExternalLink('other', '/t')),
                     lambda file, name: file.__setitem__(name, h5py.SoftLink('/events/x')),
                     lambda file, name: file.create_group(name),
                     lambda file, name: file.create_dataset(name, shape=(1 << 40,), dtype='u2', chunks=(1 << 30,))):
            self.with_columns(t=make)
            self.refused()
        with h5py.File(self.file, 'w') as file:
            file['other'] = 1
        self.assertIn('no events in the HDF5 file', self.refused())

    def test_lzf(self):
        numbers = np.arange(100_000) // 7 % 2
        lzf = lambda file, name: file.create_dataset(name, data=numbers, compression='lzf', shuffle=True)
        self.with_columns(**{name: lzf for name in 'txyp'})
        found, corruption = self.read('hdf5')
        for name in 'txyp':
            np.testing.assert_array_equal(found[name], numbers)

    def test_rows_that_are_not_there(self):
        def huge(file, name):
            file.create_dataset(name, shape=(1 << 60,), dtype='u2', chunks=(1000,), maxshape=(None,))[:10] = 1
        self.with_columns(**{name: huge for name in 'txyp'})
        found, corruption = self.read('hdf5')
        self.assertEqual(len(found['t']), 1000)
        self.assertGreater(int(corruption.split()[0]), 0)
        self.with_columns(t=huge)
        found, corruption = self.read('hdf5')
        self.assertEqual(len(found['t']), 10)

    def test_holes(self):
        for hole in 'txyp':
            with h5py.File(self.file, 'w') as file:
                for name in 'txyp':
                    dataset = file.create_dataset('events/' + name, shape=(30_000,), dtype='u2', chunks=(1000,))
                    values = np.arange(30_000) if name == 't' else np.ones(30_000)
                    for first in range(0, 30_000, 1000):
                        if name != hole or first != 5000:
                            dataset[first:first + 1000] = values[first:first + 1000]
            found, corruption = self.read('hdf5')
            self.assertEqual(corruption.split()[0], '1')
            np.testing.assert_array_equal(found['t'], np.r_[0:5000, 6000:30_000])

    def test_chunks_stored_with_other_sizes(self):
        for size in (10, 100_000):
            with h5py.File(self.file, 'w') as file:
                for name in 'txyp':
                    dataset = file.create_dataset('events/' + name, data=np.ones(3000, 'u2'), chunks=(1000,))
                dataset.id.write_direct_chunk((1000,), bytes(size))
            found, _ = self.read('hdf5')
            self.assertEqual(len(found['t']), 3000)

    def test_sums(self):
        with h5py.File(self.file, 'w') as file:
            for name in 'txyp':
                file.create_dataset('events/' + name, data=np.full(30_000, 1, 'u2'), chunks=(1000,), fletcher32=True)
            data = file['events/x'].id
            _, chunk = data.read_direct_chunk((4000,))
            data.write_direct_chunk((4000,), chunk[:100] + b'\0' + chunk[101:])
        found, corruption = self.read('hdf5')
        self.assertEqual((len(found['t']), corruption.split()[0]), (29_000, '1'))

    def test_bombs(self):
        """A chunk that would unpack to more than it should is corruption, and takes no memory."""
        rows = 1 << 20
        packed = zlib.compressobj(9)
        bomb = b''.join([packed.compress(bytes(1 << 20)) for _ in range(1000)] + [packed.flush()])
        with h5py.File(self.file, 'w') as file:
            for name in 'txyp':
                dataset = file.create_dataset('events/' + name, shape=(2 * rows,), dtype='u2', chunks=(rows,),
                                              compression='gzip')
                dataset[:] = 1
            file['events/t'].id.write_direct_chunk((0,), bomb)
        found, corruption = self.read('hdf5')
        self.assertEqual(len(found['t']), rows)
        self.assertGreater(int(corruption.split()[0]), 0)
        self.assertLess(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, 800_000)


if __name__ == '__main__':
    unittest.main()
