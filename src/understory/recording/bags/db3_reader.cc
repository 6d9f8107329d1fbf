#include <sqlite3.h>

#include <algorithm>
#include <cerrno>
#include <map>
#include <optional>
#include <utility>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/bags/compression.h"
#include "understory/recording/bags/ros2_bag.h"
#include "understory/recording/bags/sqlite_source.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/read_error.h"

namespace understory {
namespace {

constexpr std::uint8_t kZstdFrame[4] = {0x28, 0xB5, 0x2F, 0xFD};
constexpr int kMostMissingRows = 20'000;

struct CloseDatabase {
  void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
};
struct FinishStatement {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Database = std::unique_ptr<sqlite3, CloseDatabase>;
using Statement = std::unique_ptr<sqlite3_stmt, FinishStatement>;

// Throws ReadError where the system cannot read the file.
void read_through(const std::string& path) {
  constexpr std::uint64_t kSearchStep = 1U << 20;
  const auto file = open_file(path);
  std::vector<std::uint8_t> part;
  for (std::uint64_t at = 0; at < file->size(); at += kSearchStep)
    file->read(at, kSearchStep, part);
}

class Db3Source : public MessageSource {
 public:
  // `bytes` is the database if it is in memory; it must live as long as `database`. `is_file`:
  // `name` is its path.
  Db3Source(std::string name, bool is_file, Database database, std::vector<std::uint8_t> bytes,
            Log& log)
      : name_(std::move(name)),
        is_file_(is_file),
        bytes_(std::move(bytes)),
        database_(std::move(database)),
        log_(log) {
    // A file that is shorter than its header says would otherwise not be read at all.
    sqlite3_exec(database_.get(), "PRAGMA writable_schema = ON", nullptr, nullptr, nullptr);
    sqlite3_limit(database_.get(), SQLITE_LIMIT_LENGTH, static_cast<int>(kLongestBlock));
    read_topics();
    read_extent();
    indexed_ = scalar(
                   "SELECT count(*) FROM sqlite_master WHERE type = 'index' AND "
                   "tbl_name = 'messages' AND sql LIKE '%timestamp%'") > 0;
    rows_ = prepare_rows("");
  }
  ~Db3Source() override {
    rows_.reset();  // statements before their database
  }

  bool next(RawMessage& message) override {
    while (!ended_) {
      const int state = step();
      if (state == SQLITE_DONE) break;
      stored_time_ = sqlite3_column_int64(rows_.get(), 2);
      const Place place{plausible_time(stored_time_), sqlite3_column_int64(rows_.get(), 0)};
      if (damaged_after_ && place <= *damaged_after_) continue;  // was read before the damage
      last_ = place;
      const TimeNs time = place.first;
      const auto topic = topics_.find(sqlite3_column_int64(rows_.get(), 1));
      if (topic == topics_.end()) {
        log_.warn("recording.unknown_channel",
                  name_ + ": a message of an unknown topic is passed over");
        continue;
      }
      message.channel = topic->second;
      message.log_time = time;
      message.data = blob(rows_.get(), 3);
      ++read_;
      return true;
    }
    ended_ = true;  // a further step would begin anew
    return false;
  }

  void save(BinaryWriter& writer) const override {
    writer.put(indexed_);
    writer.put(ended_);
    writer.put(read_);
    writer.put(row_);
    writer.put(stored_time_);
    put_place(writer, last_);
    writer.put(damaged_after_.has_value());
    if (damaged_after_) put_place(writer, *damaged_after_);
  }
  void load(BinaryReader& reader) override {
    if (reader.get<bool>() != indexed_)
      throw InputError(name_, "", "its index is not what it was when the run was begun");
    ended_ = reader.get<bool>();
    read_ = reader.get<std::uint64_t>();
    row_ = reader.get<std::int64_t>();
    stored_time_ = reader.get<std::int64_t>();
    last_ = get_place(reader);
    if (reader.get<bool>()) damaged_after_ = get_place(reader);
    if (damaged_after_) {
      rows_ = prepare_row_by_row();
    } else if (last_ != Place{-kLatestTime, 0}) {
      rows_ = prepare_rows(indexed_ ? "WHERE timestamp >= ?1 AND (timestamp > ?1 OR id > ?2) "
                                    : "WHERE id > ?2 ");
      if (indexed_) sqlite3_bind_int64(rows_.get(), 1, stored_time_);
      sqlite3_bind_int64(rows_.get(), 2, last_.second);
    }
  }

  [[nodiscard]] std::string format() const override { return "ROS 2 bag (SQLite)"; }
  [[nodiscard]] double progress() const override {
    return end_ > begin_ ? std::clamp(static_cast<double>(last_.first - begin_) /
                                          static_cast<double>(end_ - begin_),
                                      0.0, 1.0)
                         : 0.0;
  }

  [[nodiscard]] std::vector<StoredMessage> first_messages(const WantedChannel& wanted,
                                                          std::size_t most) override {
    std::vector<StoredMessage> found;
    if (!indexed_) return found;
    for (const auto& [id, channel] : topics_) {
      if (!wanted(*channel)) continue;
      const Statement rows = prepare(
          "SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY timestamp LIMIT ?");
      if (rows == nullptr) break;
      sqlite3_bind_int64(rows.get(), 1, id);
      sqlite3_bind_int64(rows.get(), 2, static_cast<std::int64_t>(most));
      while (sqlite3_step(rows.get()) == SQLITE_ROW) {
        const ByteSpan data = blob(rows.get(), 1);
        found.push_back({channel,
                         plausible_time(sqlite3_column_int64(rows.get(), 0)),
                         {data.begin(), data.end()}});
      }
    }
    return found;
  }

 private:
  using Place = std::pair<TimeNs, std::int64_t>;  // time and row, the order of reading

  static void put_place(BinaryWriter& writer, const Place& place) {
    writer.put(place.first);
    writer.put(place.second);
  }
  static Place get_place(BinaryReader& reader) {
    const auto time = reader.get<TimeNs>();
    return {time, reader.get<std::int64_t>()};
  }

  // The disk failed, in contrast to damage. SQLite calls some failures damage, so `thoroughly`
  // looks for them in all of the file.
  void check_readable(bool thoroughly = true) const {
    sqlite3* database = database_.get();
    const int code = sqlite3_extended_errcode(database);
    if ((code & 0xFF) == SQLITE_IOERR && code != SQLITE_IOERR_SHORT_READ) {
      const int reason = sqlite3_system_errno(database);
      throw ReadError(name_, "behind message " + std::to_string(read_), reason != 0 ? reason : EIO);
    }
    if (thoroughly && is_file_ && (code & 0xFF) == SQLITE_CORRUPT) read_through(name_);
  }

  [[noreturn]] void fail(const std::string& expected) const {
    check_readable();
    throw InputError(name_, "", expected + sqlite3_errmsg(database_.get()));
  }

  Statement prepare(const std::string& query) {
    sqlite3_stmt* raw = nullptr;
    sqlite3_prepare_v2(database_.get(), query.c_str(), -1, &raw, nullptr);
    return Statement(raw);
  }

  // Without an index an order by time would need memory for all messages.
  Statement prepare_rows(const std::string& condition) {
    Statement rows = prepare("SELECT id, topic_id, timestamp, data FROM messages " + condition +
                             "ORDER BY " + (indexed_ ? "timestamp, id" : "id"));
    if (rows == nullptr) fail("expected a table of messages: ");
    return rows;
  }
  // In one transaction: else SQLite locks the file anew for each row that is missing.
  Statement prepare_row_by_row() {
    sqlite3_exec(database_.get(), "BEGIN", nullptr, nullptr, nullptr);
    return prepare("SELECT id, topic_id, timestamp, data FROM messages WHERE id = ?");
  }

  // The number that a query gives; 0 if it fails: what cannot be read is met again.
  std::int64_t scalar(const std::string& query) {
    const Statement statement = prepare(query);
    if (statement == nullptr || sqlite3_step(statement.get()) != SQLITE_ROW) return 0;
    return sqlite3_column_int64(statement.get(), 0);
  }

  static std::string text(sqlite3_stmt* statement, int column) {
    const unsigned char* raw = sqlite3_column_text(statement, column);
    if (raw == nullptr) return "";
    return {reinterpret_cast<const char*>(raw),
            static_cast<std::size_t>(sqlite3_column_bytes(statement, column))};
  }

  void read_topics() {
    const Statement rows = prepare("SELECT id, name, type, serialization_format FROM topics");
    if (rows == nullptr) fail("expected the tables of a ROS 2 bag: ");
    int state = SQLITE_ROW;
    while ((state = sqlite3_step(rows.get())) == SQLITE_ROW) {
      auto channel = std::make_shared<MessageChannel>();
      channel->topic = text(rows.get(), 1);
      channel->type = text(rows.get(), 2);
      channel->readable = text(rows.get(), 3) == "cdr";
      topics_[sqlite3_column_int64(rows.get(), 0)] = std::move(channel);
    }
    if (state != SQLITE_DONE) warn_damage("the table of topics is damaged");
  }

  void read_extent() {
    begin_ = plausible_time(scalar("SELECT min(timestamp) FROM messages"));
    end_ = plausible_time(scalar("SELECT max(timestamp) FROM messages"));
    last_row_ = scalar("SELECT max(id) FROM messages");
  }

  void warn_damage(const std::string& what) {
    check_readable();
    report_finding(log_, Finding::kDamage,
                   name_ + ": " + what + " (" + sqlite3_errmsg(database_.get()) + ")");
  }

  // The next row, SQLITE_ROW or SQLITE_DONE. At the first damage it goes over to reading row by
  // row, which finds whatever the intact pages hold.
  int step() {
    if (!damaged_after_) {
      const int state = sqlite3_step(rows_.get());
      if (state == SQLITE_ROW || state == SQLITE_DONE) return state;
      warn_damage("the database is damaged after " + std::to_string(read_) +
                  " messages; reading row by row from there");
      damaged_after_ = last_;
      // In order of rows those up to the last one are done; in order of time they may be anywhere.
      if (!indexed_) {
        row_ = last_.second;
        damaged_after_ = {-kLatestTime, 0};
      }
      rows_ = prepare_row_by_row();
      if (rows_ == nullptr) return SQLITE_DONE;
    }
    for (int missing = 0; missing < kMostMissingRows; ++missing) {
      if (last_row_ > 0 && row_ >= last_row_) return SQLITE_DONE;
      sqlite3_reset(rows_.get());
      sqlite3_bind_int64(rows_.get(), 1, ++row_);
      if (sqlite3_step(rows_.get()) == SQLITE_ROW) return SQLITE_ROW;
      check_readable(false);
    }
    return SQLITE_DONE;
  }

  ByteSpan blob(sqlite3_stmt* rows, int column) {
    const auto* raw = static_cast<const std::uint8_t*>(sqlite3_column_blob(rows, column));
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(rows, column));
    const ByteSpan stored(raw, raw == nullptr ? 0 : size);
    if (stored.size() < 4 || !std::equal(stored.begin(), stored.begin() + 4, kZstdFrame))
      return stored;
    const std::string problem = decompress(stored, "zstd", kLongestBlock, unpacked_);
    if (!problem.empty())
      report_finding(log_, Finding::kDamage,
                     name_ + ": a compressed message is damaged: " + problem);
    return unpacked_;
  }

  std::string name_;
  bool is_file_;
  std::vector<std::uint8_t> bytes_;
  Database database_;
  Log& log_;
  Statement rows_;
  std::map<std::int64_t, std::shared_ptr<const MessageChannel>> topics_;
  TimeNs begin_ = 0;
  TimeNs end_ = 0;
  bool indexed_ = false;                // and so in order of time
  Place last_{-kLatestTime, 0};         // of the last message
  std::int64_t stored_time_ = 0;        // of the last message, as the file has it
  std::optional<Place> damaged_after_;  // set: reading row by row what comes later
  std::uint64_t read_ = 0;
  bool ended_ = false;
  std::int64_t row_ = 0;
  std::int64_t last_row_ = 0;  // 0 if the damage hides it
  std::vector<std::uint8_t> unpacked_;
};

// A path as an SQLite URI.
std::string uri_of(const std::string& path) {
  constexpr const char* kDigits = "0123456789ABCDEF";
  std::string uri = "file:";
  for (const char c : path) {
    if (c == '%' || c == '?' || c == '#') {
      const auto byte = static_cast<unsigned char>(c);
      uri += {'%', kDigits[byte >> 4U], kDigits[byte & 15U]};
    } else {
      uri += c;
    }
  }
  return uri + "?mode=ro";
}

// With what its database is read from.
class SourceDb3 : public MessageSource {
 public:
  SourceDb3(std::unique_ptr<ByteSource> bytes, Log& log)
      : bytes_(std::move(bytes)), sqlite_(*bytes_) {
    sqlite3* raw = nullptr;
    const int state = sqlite3_open_v2("bag", &raw, SQLITE_OPEN_READONLY, sqlite_.vfs());
    Database database(raw);
    if (state != SQLITE_OK)
      throw InputError(bytes_->name(), "", "the SQLite database cannot be opened");
    sqlite3_exec(raw, "PRAGMA temp_store = MEMORY", nullptr, nullptr, nullptr);
    messages_.emplace(bytes_->name(), false, std::move(database), std::vector<std::uint8_t>(), log);
  }
  bool next(RawMessage& message) override { return messages_->next(message); }
  void save(BinaryWriter& writer) const override { messages_->save(writer); }
  void load(BinaryReader& reader) override { messages_->load(reader); }
  [[nodiscard]] std::string format() const override { return messages_->format(); }
  [[nodiscard]] double progress() const override { return messages_->progress(); }

 private:
  std::unique_ptr<ByteSource> bytes_;
  SqliteSource sqlite_;
  std::optional<Db3Source> messages_;
};

}  // namespace

std::unique_ptr<MessageSource> read_db3(std::unique_ptr<ByteSource> bytes, Log& log) {
  return std::make_unique<SourceDb3>(std::move(bytes), log);
}

std::unique_ptr<MessageSource> read_db3(const std::string& path, Log& log) {
  if (open_file(path)->size() == 0) throw InputError(path, "", "the file is empty");
  // A bag that was being written may have its newest part in a journal, which can be read only
  // where the folder is writable. "immutable" reads the file alone.
  for (const char* mode : {"", "&immutable=1"}) {
    sqlite3* raw = nullptr;
    const int state = sqlite3_open_v2((uri_of(path) + mode).c_str(), &raw,
                                      SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
    Database database(raw);
    if (state != SQLITE_OK) continue;
    if (sqlite3_exec(raw, "SELECT count(*) FROM sqlite_master", nullptr, nullptr, nullptr) ==
        SQLITE_CANTOPEN)
      continue;
    return std::make_unique<Db3Source>(path, true, std::move(database), std::vector<std::uint8_t>(),
                                       log);
  }
  throw InputError(path, "", "the SQLite database cannot be opened");
}

std::unique_ptr<MessageSource> read_db3(std::vector<std::uint8_t> bytes, const std::string& name,
                                        Log& log) {
  sqlite3* raw = nullptr;
  const int state = sqlite3_open_v2(":memory:", &raw, SQLITE_OPEN_READWRITE, nullptr);
  Database database(raw);
  const auto size = static_cast<sqlite3_int64>(bytes.size());
  if (state != SQLITE_OK || sqlite3_deserialize(raw, "main", bytes.data(), size, size,
                                                SQLITE_DESERIALIZE_READONLY) != SQLITE_OK)
    throw InputError(name, "", "the SQLite database cannot be opened");
  return std::make_unique<Db3Source>(name, false, std::move(database), std::move(bytes), log);
}

}  // namespace understory
