// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/text/csv_dialect.hpp"

namespace eventcamera {

namespace {

using enum EventColumn;
using enum TimeUnit;
using Header = CsvDialect::Header;

constexpr ColumnOrder txyp = {t, x, y, p};
constexpr ColumnOrder xypt = {x, y, p, t};
constexpr ColumnOrder xytp = {x, y, t, p};

constexpr NamedCsvDialect dialects[] = {
    {"names",
     "t,x,y,p in microseconds below a line of names",
     {txyp, ',', microseconds, Header::names, false, false}},
    {"metavision",
     "x,y,p,t in microseconds below a line %geometry:W,H",
     {xypt, ',', microseconds, Header::geometry, false, false}},
    {"aestream", "t,x,y,p in microseconds", {txyp, ',', microseconds, Header::none, false, false}},
    {"faery",
     "t,x,y,p in microseconds below t,x@W,y@H,on",
     {txyp, ',', microseconds, Header::names_and_size, false, true}},
    {"rpg",
     "t x y p in seconds, the Event Camera Dataset's",
     {txyp, ' ', seconds, Header::none, false, false}},
    {"e2vid",
     "t x y p in seconds below a line W H",
     {txyp, ' ', seconds, Header::size, false, false}},
    {"v2e",
     "t x y p in seconds below comments",
     {txyp, ' ', seconds, Header::comment, false, false}},
    {"esim",
     "t x y p in nanoseconds, rpg_esim's benchmark",
     {txyp, ' ', nanoseconds, Header::none, false, false}},
    {"esim-py", "x,y,t,p in seconds, OFF is -1", {xytp, ',', seconds, Header::none, true, false}},
    {"dvs-voltmeter",
     "t x y p in microseconds",
     {txyp, ' ', microseconds, Header::none, false, false}},
};

}  // namespace

std::span<const NamedCsvDialect> csv_dialects() {
  return dialects;
}

}  // namespace eventcamera
