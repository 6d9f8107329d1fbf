#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "understory/util/files/binary_io.h"

namespace understory {

// Text without the blanks, tabs and carriage returns around it.
[[nodiscard]] std::string_view trimmed(std::string_view text);
// The cells of a line of CSV. A cell in double quotes may hold commas, and two quotes for one;
// `unquoted` keeps the text of such cells.
void split_csv(std::string_view line, std::vector<std::string_view>& cells,
               std::deque<std::string>& unquoted);
// Splits at any of the separators; neighbouring separators count as one only if `merge`.
[[nodiscard]] std::vector<std::string_view> split(std::string_view line,
                                                  std::string_view separators, bool merge);
// The whole text as a number (nan and inf included); nothing if it is not one.
[[nodiscard]] std::optional<double> to_number(std::string_view text);
// The whole text as a number without sign, point or exponent; nothing if it is not one.
[[nodiscard]] std::optional<std::uint64_t> to_count(std::string_view text);
// A number with `decimals` decimals for a CSV file, empty where it is not finite; never "-0.000".
[[nodiscard]] std::string csv_cell(double value, int decimals);

// A text for a CSV file, in quotes where it holds a comma or a quote. A line's end becomes a blank:
// a cell of this program's tables never goes over a line.
[[nodiscard]] std::string csv_text(const std::string& text);

// Changes a line as it is read.
using LineEdit = std::function<void(std::string& line)>;

// Reads a text file line by line, plain or gzip by its content. Line ends are \n or \r\n. Not
// thread-safe.
class LineReader {
 public:
  static constexpr std::size_t kMaxLineBytes = std::size_t{1} << 20;

  // Every line goes through `edit`, if there is one. Throws InputError if the file cannot be
  // opened.
  explicit LineReader(const std::filesystem::path& path, LineEdit edit = {});
  ~LineReader();
  LineReader(const LineReader&) = delete;
  LineReader& operator=(const LineReader&) = delete;

  // The next line without its end; false at the end of the file. Throws InputError where the
  // compressed stream is damaged, or a line is longer than kMaxLineBytes; ReadError where the
  // system cannot read the file.
  bool next(std::string& line);
  // From now on the rest of a longer line is passed over.
  void cut_long_lines() { cut_long_lines_ = true; }
  // Lines returned so far.
  [[nodiscard]] std::size_t line_number() const { return line_number_; }
  [[nodiscard]] std::string position() const { return "line " + std::to_string(line_number_); }
  [[nodiscard]] std::string file() const { return path_.string(); }
  // Throws InputError that names the file and the line.
  [[noreturn]] void fail(const std::string& expected) const;
  // Where the next line begins, and back to there. `load` throws as `next`.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  struct Stream;
  bool refill();
  [[noreturn]] void fail_next(const std::string& expected) const;

  std::filesystem::path path_;
  LineEdit edit_;
  std::unique_ptr<Stream> stream_;
  std::size_t line_number_ = 0;
  bool cut_long_lines_ = false;
};

// What tables of different origin have in common, and where they differ.
struct CsvFormat {
  bool any_case = false;           // names of columns are compared in lower case
  bool header_in_comment = false;  // a first line "# timestamp,gx,..." holds the names
  bool exact_width = false;        // a row with empty cells beyond the names is refused, too
  // Told of a row that has too few cells, which is then passed over; empty: InputError.
  std::function<void(const std::string& problem)> on_short_row = {};
  LineEdit edit = {};  // of every line, the header too; empty: none
};

// A CSV table with a header line, read row by row, columns found by name. Empty lines and comments
// (#) are passed over. Not thread-safe.
class CsvReader {
 public:
  // Throws InputError if the file cannot be opened, or a required column is missing.
  explicit CsvReader(const std::filesystem::path& path,
                     const std::vector<std::string>& required = {}, CsvFormat format = {});

  // The column with one of these names; `require` throws InputError if there is none.
  [[nodiscard]] std::optional<std::size_t> find(const std::vector<std::string>& names) const;
  [[nodiscard]] std::size_t require(const std::vector<std::string>& names) const;
  // Names of the columns, as they stand in the file or in lower case.
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }

  bool next();  // moves to the next row; false at the end
  // The cell's text without blanks around it.
  [[nodiscard]] std::string_view text(std::size_t column) const { return trimmed(cells_[column]); }
  // The same; empty if the column is absent.
  [[nodiscard]] std::string_view text(const std::string& column) const;
  // The cell as a number; NaN if the column is absent or the cell empty. Throws InputError with the
  // line on anything else.
  [[nodiscard]] double number(const std::string& column) const;
  [[nodiscard]] double number(std::size_t column) const;
  // As number(), but an absent, empty or non-finite value is an InputError too.
  [[nodiscard]] double finite(const std::string& column) const;

  [[nodiscard]] const LineReader& lines() const { return lines_; }
  // Throws InputError that names the file and the line.
  [[noreturn]] void fail(const std::string& expected) const { lines_.fail(expected); }
  // Which rows have been read, and back to there.
  void save(BinaryWriter& writer) const { lines_.save(writer); }
  void load(BinaryReader& reader) { lines_.load(reader); }

 private:
  void read_header();

  LineReader lines_;
  CsvFormat format_;
  std::string line_;
  std::vector<std::string> names_;
  std::map<std::string, std::size_t, std::less<>> columns_;
  std::vector<std::string_view> cells_;
  std::deque<std::string> unquoted_;
};

}  // namespace understory
