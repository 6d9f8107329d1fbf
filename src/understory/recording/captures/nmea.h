#pragma once

#include <cstdint>
#include <istream>
#include <optional>
#include <string>
#include <string_view>

#include "understory/sensor/gnss_fix.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"
#include "understory/util/time.h"

namespace understory {

// What one NMEA 0183 sentence says. RMC, GGA, GNS, GSA, ZDA, HDT and THS of any talker are read,
// and PSAT,HPR and PASHR of receivers with two antennas. Others give `type` alone.
struct NmeaSentence {
  std::string type;                    // "RMC"
  std::optional<TimeNs> time_of_day;   // UTC
  std::optional<std::int64_t> day;     // since 1970-01-01
  std::optional<double> latitude_deg;  // set only where the receiver calls it valid
  std::optional<double> longitude_deg;
  std::optional<double> altitude_m;          // above the geoid
  std::optional<double> geoid_separation_m;  // geoid above the ellipsoid
  std::optional<int> quality;                // as GnssFix::quality
  std::optional<int> satellites;
  std::optional<double> hdop;
  std::optional<double> vdop;
  std::optional<double> track_deg;
  std::optional<double> speed_m_s;
  // Clockwise from true north; set only where the receiver calls it valid and measured by GNSS.
  std::optional<double> heading_deg;
  std::optional<double> heading_sd_deg;
};

// Nothing if the line is no sentence or its checksum is wrong. The checksum may be missing.
[[nodiscard]] std::optional<NmeaSentence> parse_nmea(std::string_view line);

// The fix of one or several sentences of one epoch. height_m is NaN without a GGA or GNS sentence,
// and the height above the geoid if no separation is given.
[[nodiscard]] GnssFix nmea_fix(const NmeaSentence& sentence, TimeNs stamp);

// The heading of a fix as a PASHR sentence, with its checksum, without an end of line. The date and
// what is not known of the heading are lost.
[[nodiscard]] std::string nmea_heading(const GnssFix& fix);

// Reads an NMEA log: one fix per epoch, all sentences of the epoch together. HDT and THS have no
// time: they are of the epoch of the sentence before them. Stamps are UTC; before
// the first date (RMC, ZDA) the date is taken from `first_day` (-1: unknown, then such epochs are
// left out with a warning). Lines with wrong checksums are passed over with a warning. Throws
// ReadError where the system cannot read the log.
class NmeaLogReader {
 public:
  NmeaLogReader(std::istream& stream, std::string source, std::int64_t first_day, Log& log);
  [[nodiscard]] std::optional<GnssFix> next();
  // Where the reading stands, and back to there.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  [[nodiscard]] std::optional<GnssFix> close_epoch();
  [[nodiscard]] std::optional<GnssFix> add(const NmeaSentence& sentence);

  std::istream& stream_;
  std::string source_;
  Log& log_;
  std::int64_t day_;
  TimeNs last_time_of_day_ = -1;
  std::optional<NmeaSentence> epoch_;
  std::uint64_t line_number_ = 0;
};

// The day of the first dated sentence (less one if midnight passed before it), -1 if there is none.
// `source` is for the message of a ReadError.
[[nodiscard]] std::int64_t first_nmea_day(std::istream& stream, const std::string& source);

}  // namespace understory
