#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Holds our tables of events against NumPy and h5py: what we write they read, what they write we
read. What we write as AEDAT 4 is read by Python's libraries of LZ4, Zstandard, FlatBuffers and XML.
other_readers.py TABLE_FILES"""
import collections
import io
import pathlib
import resource
import struct
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree
import zipfile
import zlib

import flatbuffers.encode
import flatbuffers.number_types as flags
import flatbuffers.packer
import flatbuffers.table
import h5py
import lz4.frame
import numpy as np
import zstandard

RAW = np.dtype({'names': ['t', 'x', 'y_p'], 'formats': ['<i8', '<u2', '<u2'],
                'offsets': [0, 8, 10], 'itemsize': 16})
TABLE_FILES = sys.argv.pop(1)
WIDTH, HEIGHT = 1280, 720
SECONDS, NANOSECONDS = 0, 3  # of TimeUnit

Report = collections.namedtuple('Report', 'places first_at outside size last_time rest')


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

    def run_reader(self, kind, options):
        words = [f'{name}={value}' for name, value in options.items()]
        return subprocess.run([TABLE_FILES, 'read', kind, self.file, self.folder / 'raw', *words],
                              stdout=subprocess.PIPE, text=True, timeout=60)

    def read(self, kind, **options):
        out = self.run_reader(kind, options)
        self.assertEqual(out.returncode, 0, out.stdout)
        raw = np.frombuffer((self.folder / 'raw').read_bytes(), RAW)
        *numbers, rest = out.stdout.split(' ', 6)
        places, first_at, outside, width, height, last = map(int, numbers)
        return ({'t': raw['t'], 'x': raw['x'], 'y': raw['y_p'] & 0x7fff, 'p': raw['y_p'] >> 15},
                Report(places, first_at, outside, (width, height), last, rest.strip()))

    def assert_equal(self, found, events):
        for name in 'txyp':
            np.testing.assert_array_equal(found[name], events[name], name)

    def assert_read(self, kind, events, **options):
        found, report = self.read(kind, **options)
        self.assertEqual((report.places, report.outside), (0, 0), report)
        self.assert_equal(found, events)
        return report

    def refused(self, kind='hdf5', **options):
        """What is said of a file that cannot be read."""
        out = self.run_reader(kind, options)
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
                       [('x', '<f2'), ('extra', '<c16', (2, 3)), ('y', 'u2'), ('name', 'U5'), ('t', 'i8'), ('on', '?')],
                       [('p', 'i1'), ('pad', 'V3'), ('time', '>f8'), (('column', 'x'), '<f2'), ('y', '>u4')]):
            for align in (False, True):
                dtype = np.dtype(fields, align=align)
                array = np.zeros(len(events['t']), dtype)
                expected = dict(events)
                for name, _ in [field[:2] for field in fields]:
                    name = name if isinstance(name, str) else name[1]  # after a title
                    key = {'timestamp': 't', 'time': 't', 'polarity': 'p', 'on': 'p'}.get(name, name)
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

    def save(self, array):
        with open(self.file, 'wb') as file:
            np.save(file, array)

    def test_we_load_small_numbers(self):
        events = random_events(30_000, 2)
        events = {'t': np.arange(30_000) * 2, 'x': events['x'] % 256, 'y': events['y'] % 256, 'p': events['p']}
        array = np.zeros(30_000, [('t', '<u2'), ('x', 'u1'), ('y', 'u1'), ('p', '?')])
        for name in 'txyp':
            array[name] = events[name]
        self.save(array)
        self.assert_read('npy', events)

    def test_we_load_numpys_rows_and_columns(self):
        for count in (1, 7, 20_000):
            events = random_events(count, 8, 100 * count, 0)
            signs = {**events, 'p': 2 * events['p'] - 1}
            rows = lambda order, kind, some=events: np.stack([some[name] for name in order], axis=1).astype(kind)
            options = {} if count > 7 else {'unit': 2}
            arrays = [rows('txyp', 'u4'), rows('txyp', 'f8'), np.asfortranarray(rows('txyp', 'i8'))]
            if count > 4:
                arrays.append(np.ascontiguousarray(rows('txyp', 'i8').T))
            if count > 7:
                arrays += [rows('xypt', '>i8', signs), rows('txyp', 'f8') / [1e6, 1, 1, 1],
                           rows('xytp', 'f8', signs) / [1, 1, 1e6, 1]]
            for array in arrays:
                self.save(array)
                self.assert_read('npy', events, columns='' if count > 7 else 'txyp', **options)
        self.save(rows('pyxt', 'i4') * [1, 1, 1, 1000] + [0, 0, 0, 999])
        self.refused('npy')
        self.assert_read('npy', events, columns='pyxt', unit=NANOSECONDS)

    def fields(self, t, p, name='t', kind='i8'):
        array = np.zeros(len(t), [(name, kind), ('x', 'i8'), ('y', 'i8'), ('p', 'i8')])
        array[name] = t
        array['p'] = np.resize(p, len(t))
        self.save(array)

    def test_units_of_numpys_times(self):
        epoch = 1_468_939_993_067_416_019
        for name, kind, times, expected in (
                ('t', 'i8', [1500, 2500], 1500), ('t_ns', 'i8', [1999, 2500], 1), ('t_ns', 'i8', [-1001, 2500], -2),
                ('time_ms', 'u8', [1500, 2500], 1_500_000), ('ts', 'i8', [epoch, epoch + 1], epoch // 1000),
                ('t', 'f8', [1.5, 2], 1_500_000), ('t', 'f8', [1500, 2500], 1500),
                ('t_s', 'f4', [1500, 2500], 1_500_000_000)):
            self.fields(times, 0, name, kind)
            self.assertEqual(self.read('npy')[0]['t'][0], expected, name)
        # Times with a fraction are rounded.
        self.fields([33 * 1e-6, 1124 * 1e-6, (1.6e9 + 33e-6) - 1.6e9, 40.5e-6], 1, kind='f8')
        np.testing.assert_array_equal(self.read('npy')[0]['t'], [33, 1124, 33, 40])
        self.fields([*np.arange(200) / 1e3, np.nan], 1, kind='f8')
        self.assertEqual(self.read('npy')[1].places, 1)

    def test_doubtful_polarities_and_times(self):
        times = np.arange(11_000) * 3
        self.fields(times, [1, 2**32 - 1])
        self.assertEqual(self.read('npy')[0]['p'][1], 0)
        for t, p in ((times, [0, 1, 2, 3]), (times, np.repeat([1, 3], [10_000, 1000])),  # not only in the first rows
                     (np.arange(11_000) * 5003, [1, -1])):
            self.fields(t, p)
            self.refused('npy')

    def test_we_load_numpys_archives(self):
        for count in (0, 1, 4095, 4096, 30_000):
            events = random_events(count, 6, 5 * count + 1, 0)
            t, x, y, p = (events[name] for name in 'txyp')
            stack = lambda order: np.stack([events[name] for name in order], axis=1)
            structured = np.zeros(count, [('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', 'u1')])
            for name in 'txyp':
                structured[name] = events[name]
            own = {**events, 'x': x.astype('u2'), 'p': p > 0, 'frames': x}
            others = {'frame': x / 2, 'K': np.ones((3, 3)), 'poses': np.ones((10, 5))}
            cases = [(own, {})]
            if count > 1:
                cases += [({**events, 'size': np.array([1280, 720])}, {}),
                          ({'ts': t / 1e6, 'xs': x, 'ys': y, 'ps': p > 0}, {}),
                          ({'folder/xs': x, 'ys': y, 'ps': p, 'timestamp_ns': t * 1000}, {}),
                          ({'x_coords': x, 'y_coords': y, 'timestamps': t, 'polarities': p}, {}),
                          ({'dataset_events_xy': stack('xy'), 'dataset_events_t': t, 'dataset_events_p': p}, {}),
                          ({'t_ns': t // 1_000_000, 'x': x, 'y': y, 'p': p}, {'unit': SECONDS}),
                          ({'events': structured}, {}), ({'arr_0': stack('xytp')}, {}),
                          ({**others, 'arr_0': stack('xytp') / [1, 1, 1e6, 1]}, {'columns': 'xytp'})]
            for arrays, options in cases:
                expected = {**events, 't': t // 1_000_000 * 1_000_000} if 'unit' in options else events
                for save in (np.savez, np.savez_compressed):
                    with open(self.file, 'wb') as file:
                        save(file, **arrays)
                    with zipfile.ZipFile(self.file, 'a') as archive:
                        archive.writestr('readme.txt', 'hello')
                    self.assert_read('npz', expected, **options)

    def test_size_of_the_sensor_in_an_archive(self):
        def size_with(width, height, places=0, names=('width', 'height'), **options):
            with open(self.file, 'wb') as file:
                np.savez(file, **random_events(10, 1, 30, 0), **dict(zip(names, (width, height))))
            found, report = self.read('npz', **options)
            self.assertEqual(report.places, places)
            self.assertEqual(len(found['t']), 10 - report.outside)
            return report.size
        self.assertEqual(size_with(1280, 720), (1280, 720))
        self.assertEqual(size_with(np.array([1280], 'u2'), 720.0), (1280, 720))
        self.assertEqual(size_with(16384, 16384, names=('a/width', 'a/height')), (16384, 16384))
        self.assertEqual(size_with(1, 720), (1, 720))  # without the events outside
        self.assertEqual(size_with(1280, 720, names=('width', 'other')), (0, 0))
        for height in 0, -1, 32769, float('nan'), 'text', [1.0, 2.0], []:
            self.assertEqual(size_with(1280, np.array(height), places=1), (0, 0), height)

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

    def columns(self, names, events, others={}):
        """Writes a file with these columns."""
        with h5py.File(self.file, 'w') as file:
            for name, column in zip(names, 'txyp'):
                file[name] = events[column]
            for name, data in others.items():
                file[name] = data

    def test_columns_are_found_by_their_names(self):
        events = random_events(1000, 3, 100_000)
        for names in (['t', 'x', 'y', 'p'], ['events/ts', 'events/xs', 'events/ys', 'events/ps'],
                      ['raw_events/t', 'raw_events/x', 'raw_events/y', 'raw_events/p'],
                      ['events/timestamp', 'events/x', 'events/y', 'events/polarity'],
                      ['prophesee/left/t', 'prophesee/left/x', 'prophesee/left/y', 'prophesee/left/p']):
            others = {'imu/t': events['t'], 'imu/x': events['t']}
            if names[0].startswith('prophesee'):
                others.update({'prophesee/right/' + name: events[name] for name in 'txyp'})
            for t in events['t'], events['t'] / 1e6:
                self.columns(names, {**events, 't': t}, others)
                self.assertEqual(self.assert_read('hdf5', events).last_time, events['t'][-1])
                self.assertEqual(len(self.read('hdf5', seek=events['t'][990])[0]['t']), 10)
        self.columns(['t_ns', 'x', 'y', 'p'], {**events, 't': events['t'] * 1000 + 7})
        self.assert_read('hdf5', events)

    def test_a_path_selects_a_camera(self):
        left, right = random_events(100, 1, 10_000), random_events(100, 2, 10_000)
        rows = np.stack([left[name] for name in 'txyp'], axis=1)
        self.columns(['left/t', 'left/x', 'left/y', 'left/p'], left,
                     {**{'right/' + name: right[name] for name in 'txyp'}, 'other/events': rows[:2],
                      'other/event_numbers': left['t']})
        self.assertEqual(self.assert_read('hdf5', left).rest, 'events in /other/events, /right')
        self.assertEqual(self.assert_read('hdf5', left, path='left').rest, '')
        self.assert_read('hdf5', right, path='/right/')
        for path in 'other', 'other/events':
            self.assertEqual(self.read('hdf5', path=path)[1].last_time, left['t'][1])
        self.assertIn('/left, /other/events, /right', self.refused(path='middle'))

    def test_unit_and_columns_may_be_set(self):
        events = random_events(1000, 4, 100_000)
        nanoseconds = {**events, 't': events['t'] * 1000 + 7}
        self.columns('txyp', nanoseconds)
        self.assertIn('time-unit', self.refused())
        self.assert_read('hdf5', events, columns='pyxt', unit=NANOSECONDS)
        with h5py.File(self.file, 'w') as file:
            file['events'] = np.stack([nanoseconds[name] for name in 'pyxt'], axis=1)
        self.assert_read('hdf5', events, columns='pyxt', unit=NANOSECONDS)

    def test_rows_are_records_or_numbers(self):
        events = random_events(1000, 5, 100_000)
        signs = {**events, 't': events['t'] / 1e6, 'p': 2 * events['p'] - 1}
        records = np.zeros(1000, [('x', 'u2'), ('y', 'u2'), ('polarity', 'i2'), ('timestamp', 'i8')])
        for name, column in zip(records.dtype.names, 'xypt'):
            records[name] = events[column]
        stack = lambda order: np.stack([signs[name] for name in order], axis=1)
        # The last is MVSEC's, of a DAVIS346.
        for path, rows, size in (('events', records, (0, 0)), ('events', stack('txyp'), (0, 0)),
                                 ('events', stack('xytp'), (0, 0)), ('davis/right/events', stack('xytp'), (346, 260))):
            with h5py.File(self.file, 'w') as file:
                file[path] = rows
            found, report = self.read('hdf5')
            self.assertEqual((report.places, report.size), (0, size))
            kept = np.full(1000, True) if size == (0, 0) else (events['x'] < 346) & (events['y'] < 260)
            self.assert_equal(found, {name: events[name][kept] for name in 'txyp'})

    def test_the_size_may_be_an_attribute(self):
        self.columns('txyp', random_events(100, 6, 10_000))
        with h5py.File(self.file, 'a') as file:
            file.attrs['sensor_resolution'] = [720, 1280]
        self.assertEqual(self.read('hdf5')[1].size, (1280, 720))

    def check_seeks(self, events, times):
        for t in times:
            first = np.argmax(events['t'] >= t)
            self.assert_equal(self.read('hdf5', seek=t)[0], {name: events[name][first:] for name in 'txyp'})

    def write_times_of_32_bits(self, events, of_v2e):
        table = {name: events[name].astype('u4') for name in 'txyp'}
        with h5py.File(self.file, 'w') as file:
            if of_v2e:
                file['events'] = np.stack([table[name] for name in 'txyp'], axis=1)
            else:
                for name in 'txyp':
                    file['events/' + name] = table[name]

    def test_times_of_32_bits_wrap_without_an_index(self):
        i = np.arange(30_000)
        events = {'t': i * 500_000, 'x': i % 300, 'y': i % 200, 'p': i % 2}  # four hours: three wraps
        for of_v2e in False, True:
            self.write_times_of_32_bits(events, of_v2e)
            self.assertEqual(self.assert_read('hdf5', events).last_time, events['t'][-1])
            self.check_seeks(events, [events['t'][k] for k in (29_999, 8589, 8590, 8591, 20_000, 100, 0)])

    def test_disorder_across_a_wrap_is_kept(self):
        lap = 1 << 32
        t = np.array([lap - 1, lap + 2, lap - 2, lap + 3, lap - 0x10000, lap - 0xffff, lap + 4, lap + 5, lap - 3])
        events = {'t': t, **{name: np.ones(9, int) for name in 'xyp'}}
        for of_v2e, has_index in ((False, False), (True, False), (False, True)):
            self.write_times_of_32_bits(events, of_v2e)
            if has_index:  # the first event at or after each millisecond
                with h5py.File(self.file, 'a') as file:
                    file['ms_to_idx'] = np.append(np.zeros(lap // 1000 + 1, 'u4'), np.uint32(9))
            self.assertEqual(self.read('hdf5')[1].last_time, lap - 3)
            self.assert_equal(self.read('hdf5')[0], events)
            self.check_seeks(events, [lap + 5])

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


class Text(TableTest):
    """Lines of any tool."""

    TWO = [(10, 3, 4, 1), (12, 5, 6, 0)]

    def read_text(self, text, **options):
        self.file.write_bytes(text if isinstance(text, bytes) else text.encode())
        found, report = self.read('csv', **options)
        return list(zip(*(found[name].tolist() for name in 'txyp'))), report

    def assert_events(self, events, *texts, **options):
        for text in texts:
            found, report = self.read_text(text, **options)
            self.assertEqual((found, report.places), (events, 0), text)

    def refused_text(self, text):
        self.file.write_bytes(text if isinstance(text, bytes) else text.encode())
        return self.refused('csv')

    def test_columns_by_names(self):
        self.assert_events(
            self.TWO, 't,x,y,p\n10,3,4,1\n12,5,6,0\n', 'x;y;polarity;timestamp\n3;4;1;10\n5;6;-1;12\n',
            '"X", "Y", "Pol", "Time"\r\n3, 4, True, 10\r\n5, 6, False, 12', 'id t   x y p note\n1 10 3  4 1 a\n2 12 5 6 0 b\n',
            '\ufefft,x,y,p\n10,3,4,1\n12,5,6,0\n', 't,x@640,y@480,on\r\n10,3,4,1\r\n12,5,6,0\r\n')
        self.assert_events(
            self.TWO, 'event_timestamp,x,y,polarity\n10,3,4,1\n12,5,6,0\n', 'row,col,t,p\n4,3,10,1\n6,5,12,0\n',
            'x_coords,y_coords,timestamps,polarities\n3,4,10,1\n5,6,12,0\n',
            'timestamp_microseconds,x,y,p\n10,3,4,1\n12,5,6,0\n', 't_\u03bcs,x,y,p\n10,3,4,1\n12,5,6,0\n',
            'TD.x TD.y TD.p TD.ts\n3 4 1 10\n5 6 0 12\n', "'t','x','y','p'\n10,3,4,1\n12,5,6,0\n",
            '# y x p t\n4 3 1 10\n6 5 0 12\n', '#y,x,p,t\n4,3,1,10\n6,5,0,12\n',
            '# y [px] x [px] p t [us]\n4 3 1 10\n6 5 0 12\n', '% columns: y, x, p, t\n4,3,1,10\n6,5,0,12\n', unit=2)
        # The last two: names that do not fit the lines, and comments with other words.
        self.assert_events(self.TWO, '# t [ns] y x p\n10000 4 3 1\n12000 6 5 0\n',
                           '# t x y p label\n10,3,4,1\n12,5,6,0\n', '# the events: t, x, y and p\n3,4,1,10\n5,6,0,12\n')

    def test_columns_by_the_first_lines(self):
        self.assert_events(
            self.TWO, '10,3,4,1\n12,5,6,0\n', '3,4,1,10\n5,6,0,12\n', '3,4,1,10\n5,6,-1,12\n',
            '0.000010 3 4 1\n0.000012 5 6 0\n', '3\t4\t1e-5\t1\n5\t6\t1.2e-5\t-1\n',
            '# t x y p\n\n10 3 4 true\n# more\n12 5 6 FALSE', '%geometry:640,480\n3,4,1,10\n5,6,0,12\n',
            '240 180\n0.00001 3 4 1\n0.000012 5 6 0\n', '1.0e-05 3.00e+00 4.00e+00 1.00e+00\n1.2e-05 5.00e+00 6.00e+00 0.00e+00\n')
        for text, size in (('t,x@640,y@480,on\r\n10,3,4,1\r\n', (640, 480)), ('%geometry:640,480\n3,4,1,10\n', (640, 480)),
                           ('240 180\n0.00001 3 4 1\n', (240, 180))):
            self.assertEqual(self.read_text(text)[1].size, size)
        self.assert_events([(0, 5, 3, 1)], '%geometry:640,480\n5,3,1,0\n')  # the only events that could be txyp as well
        # Out of order, but with one column of seconds.
        self.assert_events([(10, 3, 4, 1), (2, 5, 6, 0)], '3 4 0.00001 1\n5 6 0.000002 0\n')

    def test_order_and_unit_as_set(self):
        self.assert_events([(10, 3, 4, 1), (2, 5, 6, 0)], '1,4,3,10\n0,6,5,2\n', columns='pyxt')
        self.assert_events([(10, 3, 4, 1)], 'a,b,c,d\n1,4,3,10\n', columns='pyxt')
        self.assert_events([(10, 3, 4, 1), (10, 5, 6, 0)], '10499 3 4 1\n10500 5 6 0\n', columns='txyp', unit=NANOSECONDS)
        self.assert_events([(10_000_000, 3, 4, 1)], '10 3 4 1\n', columns='txyp', unit=SECONDS)
        self.assert_events(self.TWO, '7,10,a,3,4,1\n7,12,b,5,6,0\n', columns='-t-xyp')
        for letters in 'txy', 'txyy', 'txyq', 'txypt', 'TXYP':
            self.refused('csv', columns=letters)

    def test_unit_by_the_name_of_the_column(self):
        self.assert_events(
            self.TWO, 't_ns,x,y,p\n10000,3,4,1\n12000,5,6,0\n', 'x y p Timestamp_NS\n3 4 1 10999\n5 6 0 12000\n',
            't_us,x,y,p\n10.0,3,4,1\n12.0,5,6,0\n', 'time [us];x;y;p\n10;3;4;1\n12;5;6;0\n',
            't(s),x,y,p\n0.00001,3,4,1\n0.000012,5,6,0\n', 'time_ms,x,y,p\n0.01,3,4,1\n0.012,5,6,0\n',
            't_\xb5s,x,y,p\n10,3,4,1\n12,5,6,0\n', 't (events),x,y,p\n10,3,4,1\n12,5,6,0\n')
        self.assert_events([(1_000_000, 3, 4, 1), (2_000_000, 5, 6, 0)], 't_s,x,y,p\n1,3,4,1\n2,5,6,0\n')
        self.assert_events([(1000, 3, 4, 1), (2000, 5, 6, 0)], 't_ms,x,y,p\n1,3,4,1\n2,5,6,0\n' + '#' * 200)
        self.assert_events([(10, 3, 4, 1)], 't_us,x,y,p\n10000,3,4,1\n', unit=NANOSECONDS)  # settings take precedence
        self.refused_text('t_kg,x,y,p\n10,3,4,1\n')

    def test_whole_numbers_tell_their_unit_or_are_refused(self):
        def lines(first, step, gap, separator):
            """Times that are multiples of `step`, with gaps of up to `gap` steps."""
            gaps = np.random.default_rng(1).integers(0, gap + 1, 300) * step
            times = first + np.append(0, np.cumsum(gaps)[:-1])
            return ''.join(separator.join([str(t), str(i % 200), '7', '1']) + '\n' for i, t in enumerate(times))
        epoch = 1_468_939_993_067_416
        for text, first in ((lines(5000, 1000, 100, ' '), 5),  # esim, of a camera with microseconds
                            (lines(5001, 1, 10, ' '), 5001),   # DVS-Voltmeter
                            # Only one of the units gives a plausible date.
                            (lines(1000 * epoch + 19, 7, 100, ' '), epoch), (lines(epoch, 7, 100, ' '), epoch),
                            (lines(1000 * epoch + 19, 7, 100, ','), epoch),
                            (lines(5001, 7, 100, ','), 5001)):  # between commas, close times are microseconds
            self.assertEqual(self.read_text(text)[0][0][0], first, text[:40])
        for text in (lines(5001, 7, 100, ' '), lines(5000, 0, 1, ' '), lines(5000, 1000, 100, ','),
                     lines(5001, 0, 1, '\t'), '1000 3 4 1\n2000 3 4 1\n'):
            self.assertIn('time-unit', self.refused_text(text))
            self.assertEqual(self.read_text(text, unit=NANOSECONDS)[0][0][0], int(text[0]))

    def test_implausible_times(self):
        def table(time):
            return 't,x,y,p\n' + ''.join(f'{time(i)},3,4,{1 - 2 * (i % 2)}\n' for i in range(1000))
        # Nanoseconds, microseconds with fractions, frame numbers, nanoseconds since boot, milliseconds since 1970.
        for text in (table(lambda i: 5000 + i * 1234), table(lambda i: f'{i * 10}.25'), table(lambda i: i // 100),
                     table(lambda i: 5_000_000_000_000 + i * 200), table(lambda i: 1_600_000_000_000 + i // 10),
                     't,x,y,p\n100007,1,1,1\n200007,1,1,-1\n1300007,1,1,1\n1000400007,1,1,1\n',
                     't,x,y,p\n100.5,1,1,1\n200.5,1,1,-1\n20000.5,1,1,1\n1000400.5,1,1,1\n'):
            self.assertIn('time-unit', self.refused_text(text))
            self.assertTrue(self.read_text(text, unit=NANOSECONDS)[0])
        # A day's pause, and frames at their times, are plausible.
        for time in lambda i: i * 50 + i // 500 * 86_400_000_000, lambda i: i // 50 * 33_333:
            self.assertEqual(len(self.read_text(table(time))[0]), 1000)

    def test_floating_point_microseconds(self):
        self.assert_events(
            self.TWO, '1.000e+01 3.0e+00 4.0e+00 1.0e+00\n1.200e+01 5.0e+00 6.0e+00 0.0e+00\n',
            '10.000000 3.000000 4.000000 1.000000\n12.000000 5.000000 6.000000 0.000000\n', 't,x,y,p\n10.0,3,4,1\n12.0,5,6,0\n')
        # Full seconds with all decimals.
        self.assert_events([(1_000_000, 3, 4, 1), (2_000_000, 5, 6, 0)], '1.000000 3 4 1\n2.000000 5 6 0\n')
        self.refused_text('1.0e+01 3.0e+00 4.0e+00 1.0e+00\n')

    def test_index_of_pandas(self):
        self.assert_events(
            self.TWO, ',t,x,y,p\n0,10,3,4,1\n1,12,5,6,0\n', '"","t","x","y","p"\n"0",10,3,4,1\n"1",12,5,6,0\n',
            ' t x y p\n0 10 3 4 1\n1 12 5 6 0\n', '0,10,3,4,1\n1,12,5,6,0\n', '0,3,4,1,10\n1,5,6,0,12\n')
        self.refused_text('5,10,3,4,1\n9,12,5,6,0\n')

    def test_seconds_are_exact(self):
        # Also in long files, which take the fast path.
        rows = [(i * 991 % 1_000_000, i % 1000, i % 100) for i in range(1000)]
        self.assert_events([(1_468_939_993_000_000 + us + (ns >= 750), x, 2, 1) for us, ns, x in rows],
                           ''.join(f'1468939993.{us:06}{ns:03} {x} 2 1\n' for us, ns, x in rows))
        for text, times in (('0.0 1 1 1\n0.12345678949999 1 1 1\n0.1234565 1 1 1\n1 1 1 1\n2.5 1 1 1\n',
                             (0, 123_457, 123_456, 1_000_000, 2_500_000)),
                            # A double that is just below its microsecond, printed with all its digits.
                            ('1.00000299999999995 1 1 1\n1.99999999999999978 1 1 1\n2.5 1 1 1\n', (1_000_003, 2_000_000, 2_500_000)),
                            ('t_ns,x,y,p\n999,1,1,1\n1999,1,1,1\n2000,1,1,1\n', (0, 1, 2))):
            self.assert_events([(t, 1, 1, 1) for t in times], text + '#' * 200)

    def test_corruption_is_skipped_and_counted(self):
        good = '10,10,10,1\n' * 250
        found, report = self.read_text(
            't,x,y,p\n1,1,1,1\n2,2,2\n6,70000,6,1\n7,7,40000,1\n8,-1,8,1\n3,9,9,0\n' + good + '3,3,3,1,1\n' + good +
            'four,4,4,1\n' + good + '5,5,5,2\n' + good + '99999999999999999999,1,1,1\n')
        self.assertEqual(found, [(1, 1, 1, 1), (3, 9, 9, 0)] + [(10, 10, 10, 1)] * 1000)
        self.assertEqual((report.places, report.first_at, report.outside), (5, 16, 3))
        found, report = self.read_text('t,x@10,y@8,p\n1,9,7,1\n1,10,7,1\n1,9,8,1\n')
        self.assertEqual((len(found), report.outside), (1, 2))

    def test_more_than_one_bad_line_in_a_hundred_is_refused(self):
        def lines(good, bad):
            return 't,x,y,p\n' + ''.join(f'{i},1,1,1\n' for i in range(good)) + 'bad,1,1,1\n' * bad + '5000,1,1,1\n'
        for good, bad in (100, 1), (10_000, 100):
            self.assertEqual(self.read_text(lines(good, bad))[1].places, bad)
        # Separators of thousands, a decimal comma between commas, and rows with more fields than names.
        for text, words in (
                (lines(3, 1), 'line 5: "bad,1,1,1"'), (lines(1000, 15), 'line 1002: '), (lines(10_000, 150), 'line 10002: '),
                ('t,x,y,p\n100,10,20,1\n1,300,11,21,0\n1,000,400,12,22,1\n', 'line 3: "1,300,11,21,0" (fields: 5, expected: 4)'),
                ('t,x,y,p\n0,000100,10,20,1\n0,001300,11,21,0\n', ''), ('t,x,y,p\n100,10,20,1,5\n200,11,21,0,5\n', '')):
            self.assertIn(words, self.refused_text(text))
        self.assertEqual(len(self.read_text('t,x,y,p\n1,1,1,1\n2,1,')[0]), 1)  # a last line may be cut off

    def test_numbers_as_spreadsheets_write_them(self):
        self.assert_events(
            [(100, 10, 20, 1), (200, 11, 21, 0), (1300, 12, 22, 1), (1_000_400, 13, 23, 1)],
            't;x;y;p\n0,000100;10;20;1\n0,000200;11;21;0\n0,001300;12;22;1\n1,000400;13;23;1\n',
            't\tx\ty\tp\n0,0001\t10\t20\t1\n0,0002\t11\t21\t0\n0,0013\t12\t22\t1\n1,0004\t13\t23\t1\n',
            '0,0001 10 20 1\n0,0002 11 21 0\n0,0013 12 22 1\n1,0004 13 23 1\n',
            't,x,y,p\n"0,0001",10,20,1\n"0,0002",11,21,0\n"0,0013",12,22,1\n"1,0004",13,23,1\n',
            't;x;y;p\n100,0;10,0;20,0;1,0\n200,0;11,0;21,0;0,0\n1.300,0;12,0;22,0;1,0\n1.000.400,0;13,0;23,0;1,0\n',
            't;x;y;p\n100;10;20;1\n200;11;21;0\n1,300;12;22;1\n1,000,400;13;23;1\n',
            't,x,y,p\n100,10,20,1\n200,11,21,0\n"1,300",12,22,1\n"1,000,400",13,23,1\n',
            "t;x;y;p\n100;10;20;1\n200;11;21;0\n1'300;12;22;1\n1'000'400;13;23;1\n",
            '"t","x","y","p"\n"100","10","20","1"\n"200","11","21","0"\n"1300","12","22","1"\n"1000400","13","23","1"\n',
            't,x,y,p,\n100,10,20,1,\n200,11,21,0,\n1300,12,22,1,\n1000400,13,23,1,\n')
        self.assertIn('decimal point', self.refused_text('t;x;y;p\n1,300;12;22;1\n1,400;13;23;1\n'))
        self.refused_text('t;x;y;p\n1.300;12;22;1\n1.000.400;13;23;1\n')

    def test_polarities_of_any_tool(self):
        self.assert_events(
            self.TWO, 't,x,y,p\n10,3,4,2\n12,5,6,1\n', '10,3,4,2\n12,5,6,1\n', 't,x,y,p\n10,3,4,ON\n12,5,6,OFF\n',
            't,x,y,p\n10,3,4,pos\n12,5,6,neg\n', 't,x,y,p\n10,3,4,1\n12,5,6,4294967295\n',
            't,x,y,p\n10,3,4,1.0\n12,5,6,-1.0\n', '10 3 4 on\n12 5 6 off\n# end\n', unit=2)
        # Also in long files, where 1 is read fast elsewhere.
        found, _ = self.read_text('t,x,y,p\n' + ''.join(f'{i},3,4,{1 + (i % 4 == 0)}\n' for i in range(1000)))
        self.assertEqual(sum(p for *_, p in found), 250)
        self.assertIn('are 0 1 2;', self.refused_text('t,x,y,p\n1,1,1,0\n2,1,1,1\n3,1,1,2\n'))
        self.assertIn('are 0 1 2 3;', self.refused_text('t,x,y,p\n1,1,1,0\n2,1,1,1\n3,1,1,2\n4,1,1,3\n'))
        self.assertIn('unsigned', self.refused_text('t,x,y,p\n1,1,1,0\n2,1,1,255\n'))

    def test_utf_16(self):
        for encoding in 'utf-16-le', 'utf-16-be':
            self.assert_events(
                self.TWO, '\ufefft_\u03bcs;x;y;p;\U0001f600\r\n10;3;4;1;a\r\n12;5;6;0;b\r\n'.encode(encoding))

    def test_a_long_line_is_skipped(self):
        start = 't,x,y,p\n1,1,1,1\n' + '2,1,1,1\n' * 300
        found, report = self.read_text(
            start + '3,1,1,' + '1' * 1_000_000 + '\n4,1,1,1\n5,1,1,1' + ' ' * 4089 + '\n'  # the maximum length
            '6,1,1,1' + ' ' * 4090 + '\n7,1,1,1\n')
        self.assertEqual((len(found), report.places, report.first_at), (304, 2, len(start)))

    def test_other_texts(self):
        for text in ('5', 'hello\n', '{"a": 1}\n', '1 2 3\n4 5 6\n7 8 9\n', '% evt 3.0\n% end\n\1\2\3\n', '1' * 100_000,
                     '\0' * 100_000, np.random.default_rng(3).bytes(200_000), '5,6,7,8\n9,10,11,12\n', '5,6,7,1\n3,6,6,1\n'):
            self.refused_text(text)
        # Without events.
        self.assert_events([], 't,x,y,p\n', 't,x,y,p', '# t,x,y,p\n', '%geometry:640,480\n', '\n', '')


class Aedat4(TableTest):
    """A packet is a FlatBuffer, whose fields have the numbers of src/formats/aedat/aedat4.fbs."""

    def root(self, content, identifier):
        self.assertEqual(struct.unpack_from('<I', content)[0], len(content) - 4)
        self.assertEqual(content[8:12], identifier)
        return flatbuffers.table.Table(content, 4 + flatbuffers.encode.Get(flatbuffers.packer.uoffset, content, 4))

    def scalar(self, table, number, kind):
        offset = table.Offset(4 + 2 * number)
        return table.Get(kind, offset + table.Pos) if offset else 0

    def vector(self, table, number):
        """The position and the length of a vector."""
        field = table.Offset(4 + 2 * number)
        return table.Vector(field), table.VectorLen(field)

    def tables(self, packet):
        start, count = self.vector(packet, 0)
        return [flatbuffers.table.Table(packet.Bytes, packet.Indirect(start + 4 * i)) for i in range(count)]

    def test_packets(self):
        unpack = {0: bytes, 1: lz4.frame.decompress, 2: lz4.frame.decompress}
        zstd = lambda data: zstandard.ZstdDecompressor().decompress(data, max_output_size=1 << 26)
        events = random_events(9000, 14, first=1000)
        for compression in range(5):
            for has_table in False, True:
                self.write(f'aedat4{compression}' + '-table' * has_table, events)
                self.check(self.file.read_bytes(), unpack.get(compression, zstd), events, compression, has_table)

    def check(self, data, unpack, events, compression, has_table):
        self.assertEqual(data[:14], b'#!AER-DAT4.0\r\n')
        at = 18 + struct.unpack_from('<I', data, 14)[0]
        header = self.root(data[14:at], b'IOHE')
        self.assertEqual(self.scalar(header, 0, flags.Int32Flags), compression)
        table_at = self.scalar(header, 1, flags.Int64Flags)
        self.assertEqual(table_at > 0, has_table)
        info = xml.etree.ElementTree.fromstring(header.String(header.Pos + header.Offset(8)))
        kinds = {}
        for stream in info.find("node[@name='outInfo']"):
            self.assertTrue(stream.get('path').endswith('/outInfo/%s/' % stream.get('name')))
            kinds[int(stream.get('name'))] = stream.find("attr[@key='typeIdentifier']").text.encode()
            self.assertEqual(stream.find("node[@name='info']/attr[@key='sizeX']").text, str(WIDTH))
        found, edges, samples, frames, packets = [], [], [], [], 0
        while at < (table_at if has_table else len(data)):
            stream, size = struct.unpack_from('<ii', data, at)
            packet = self.root(unpack(data[at + 8:at + 8 + size]), kinds[stream])
            at, packets = at + 8 + size, packets + 1
            if kinds[stream] == b'EVTS':
                start, count = self.vector(packet, 0)
                found += struct.iter_unpack('<qhh?3x', packet.Bytes[start:start + 16 * count])
            elif kinds[stream] == b'TRIG':
                edges += [(self.scalar(edge, 0, flags.Int64Flags), self.scalar(edge, 1, flags.Int8Flags))
                          for edge in self.tables(packet)]
            elif kinds[stream] == b'IMUS':
                samples += [(self.scalar(sample, 0, flags.Int64Flags),
                             *(self.scalar(sample, i, flags.Float32Flags) for i in range(1, 11)))
                            for sample in self.tables(packet)]
            else:
                start, count = self.vector(packet, 10)
                frames.append((self.scalar(packet, 0, flags.Int64Flags), packet.Bytes[start:start + count]))
        self.assert_equal(dict(zip('txyp', np.array(found).T)), events)
        self.assertEqual(edges, [(1001, 1), (1002, 2), (1003, 8)])
        self.assertEqual(samples, [(1004, 40, *range(1, 10)), (1005, 39, *range(-1, -10, -1))])
        self.assertEqual(frames, [(events['t'][-1], bytes([3]) * (WIDTH * HEIGHT))])
        if has_table:
            table = self.root(unpack(data[at:]), b'FTAB')
            self.assertEqual(self.vector(table, 0)[1], packets)


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

    def test_numpys_rows(self):
        array = np.zeros(105, [('t', '<u8'), ('x', '<i4'), ('y', '<i4'), ('p', '<i4')])
        array['t'], array['x'], array['y'], array['p'] = 4, 1, 16383, 1
        for row, field, value in ((1, 't', 1 << 63), (2, 'x', -1), (3, 'x', 70_000), (4, 'y', 16384)):
            array[row][field] = value
        stream = io.BytesIO()
        np.save(stream, array)
        file = stream.getvalue()
        self.file.write_bytes(file)
        found, report = self.read('npy')
        self.assertEqual(len(found['t']), 101)
        self.assertEqual((report.places, report.first_at, report.outside), (1, len(file) - 104 * 20, 3))
        for corrupt in file + bytes(1000), file[:-20], file[:-1]:
            self.file.write_bytes(corrupt)
            self.assertEqual(self.read('npy')[1].places, 2)

    def test_headers_of_numpy(self):
        txy = "[('t', '<u8'), ('x', '<i4'), ('y', '<i4'), "
        fields = txy + "('p', '<i4')]"
        array = lambda descr, shape, rest='': f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, {rest}}}"
        headers = [array("'<f8'", shape) for shape in ('(3, 500)', '(5, 3)', '(5,)', '(5, 0)', '(5, 4, 1)', '()')]
        headers += [array(descr, '(5,)') for descr in (
            '[]', "[('t', '<u8')]", '[[', '[(', txy + ']', txy + "('p', '<i4'), ('p', '<i4')]", txy + "('p', '<c8')]",
            txy + "('p', '<i3')]", txy + "('p', '<i4', (2,))]", txy + "('p', [('q', '<i4')])]",
            txy + "('p', '<i4'), ('', '|V99999999999')]", txy + "('p', '<i4')",
            txy + "('p', '<i4'), ('b', '|V60000', (65535, 65535))]")]
        headers += [array(fields, shape) for shape in ('()', '(5, 4)', '(-1,)', '(5', '5', '(99999999999999999999,)', '(x,)')]
        headers += [array("'<c8'", '(5, 4)'), f"{{'descr': {fields}, 'fortran_order': False}}",
                    array(fields, '(1,)') + ' more', array(fields, '(1,)', "'other': 3"),
                    "{'descr': '<f8', 'fortran_order': True, 'shape': (5, 4)}"]  # cut short
        files = [b'\x93NUMPY\1\0' + struct.pack('<H', len(header)) + header.encode() for header in headers]
        for file in [b'', b'hello, this is a text', b'\x93NUMPY', b'\x93NUMPY\4\0\x10\0',
                     b"\x93NUMPY\2\0\xff\xff\xff\xff{'descr'", *files]:
            self.file.write_bytes(file)
            self.refused('npy')

    def archive(self, arrays, text=None, cut=None):
        with open(self.file, 'wb') as file:
            np.savez_compressed(file, **arrays)
        if text is not None:
            self.file.write_bytes(text)
        self.file.write_bytes(self.file.read_bytes()[:cut])

    def test_archives(self):
        columns = random_events(10, 1)
        for arrays, words, options in (
                ({}, 'neither arrays t, x, y and p', {}), ({'a': np.zeros((3, 500))}, '(N, 4) or (4, N)', {}),
                ({'a': np.array(None)}, 'pickled', {}), ({'K': np.ones((3, 3))}, 'K.npy: the NumPy array has 3 columns', {}),
                ({'poses': np.ones((10, 5))}, 'column-order has 4', {'columns': 'txyp'}),
                ({'poses': np.ones((10, 5))}, 'set column-order for all 5', {}),
                ({**columns, 'x': np.zeros((10, 2), 'u2')}, 'must have one column', {}),
                ({name: columns[name] for name in 'txy'}, 'neither arrays t, x, y and p', {})):
            self.archive(arrays)
            self.assertIn(words, self.refused('npz', **options))
        for file in {'text': b'hello, this is a text'}, {'cut': -30}:
            self.archive(columns, **file)
            self.assertIn('cannot be opened', self.refused('npz'))

        events = random_events(50_000, 2)
        self.archive({**events, 'y': events['y'][:100]})
        found, report = self.read('npz')
        self.assertEqual((len(found['t']), report.places), (100, 1))
        with zipfile.ZipFile(self.file, 'w') as archive:
            for name in 'txyp':  # more rows than there are
                stream = io.BytesIO()
                np.save(stream, events[name])
                archive.writestr(name + '.npy', stream.getvalue().replace(b'50000', b'90000', 1))
        found, report = self.read('npz')
        self.assertEqual((len(found['t']), report.places), (50_000, 1))
        file = bytearray(self.file.read_bytes())
        file[300_000:300_010] = bytes(10)
        self.file.write_bytes(file)
        self.assertGreater(self.read('npz')[1].places, 0)

    def test_compressed_twice(self):
        with h5py.File(self.file, 'w') as file:
            for name in 'xyp':
                file['events/' + name] = np.zeros(1 << 16, 'u8')
            creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            creation.set_chunk((1 << 16,))
            creation.set_deflate(1)
            creation.set_filter(h5py.h5z.FILTER_DEFLATE, 0, (1,))
            h5py.h5d.create(file['events'].id, b't', h5py.h5t.STD_U64LE, h5py.h5s.create_simple((1 << 16,)), creation)
        self.assertIn('compressed more than once', self.refused())

    def test_chunks_that_share_an_address(self):
        rows, chunks = 1 << 16, 30
        with h5py.File(self.file, 'w', libver='earliest') as file:
            for name in 'xyp':
                file['events/' + name] = np.zeros(rows * chunks, 'u1')
            t = file.create_dataset('events/t', (rows * chunks,), 'u8', chunks=(rows,), compression='gzip').id
            for i in range(chunks):
                t.write_direct_chunk((rows * i,), bytes(400_000 if i == 0 else 1))
        self.read('hdf5')
        # Nodes of chunk indexes: a header of 24 bytes with the number of chunks, then for each chunk its size,
        # filter mask and two offsets, and its address.
        file = bytearray(self.file.read_bytes())
        at = file.find(b'TREE\1')
        while at >= 0:
            first = at + 24
            if struct.unpack_from('<I', file, first)[0] == 400_000:
                for i in range(1, file[at + 6]):
                    file[first + 32 * i:first + 32 * i + 4] = file[first:first + 4]
                    file[first + 32 * i + 24:first + 32 * i + 32] = file[first + 24:first + 32]
            at = file.find(b'TREE\1', at + 1)
        self.file.write_bytes(file)
        self.assertIn('chunks that overlap', self.refused())

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
        found, report = self.read('hdf5')
        for name in 'txyp':
            np.testing.assert_array_equal(found[name], numbers)

    def test_rows_that_are_not_there(self):
        def huge(file, name):
            file.create_dataset(name, shape=(1 << 60,), dtype='u2', chunks=(1000,), maxshape=(None,))[:10] = 1
        self.with_columns(**{name: huge for name in 'txyp'})
        found, report = self.read('hdf5')
        self.assertEqual(len(found['t']), 1000)
        self.assertGreater(report.places, 0)
        self.with_columns(t=huge)
        found, report = self.read('hdf5')
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
            found, report = self.read('hdf5')
            self.assertEqual(report.places, 1)
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
        found, report = self.read('hdf5')
        self.assertEqual((len(found['t']), report.places), (29_000, 1))

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
        found, report = self.read('hdf5')
        self.assertEqual(len(found['t']), rows)
        self.assertGreater(report.places, 0)
        self.assertLess(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, 800_000)


if __name__ == '__main__':
    unittest.main()
