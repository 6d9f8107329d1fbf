#pragma once

#include <filesystem>
#include <string>

namespace understory {

// Whether a name is taken: also by a link that leads to nothing.
[[nodiscard]] bool is_there(const std::filesystem::path& path);

// The part of a run folder that belongs to the command at work: RUN/.understory. Its content:
//   marker        a text that names this program and the version of the format
//   lock          held by the process at work; it falls with the process (util/files/file_lock.h)
//   results/      results until they are put in place
//   placed        names of the results in the run folder that are this program's, while they are
//                 being put in place
//   checkpoint*.bin, other names with .bin, tiles/
//                 state of a mapping run, from which it can be resumed
// Anything else in it is not of this program and is left alone.
[[nodiscard]] std::filesystem::path work_folder_of(const std::filesystem::path& run_folder);
[[nodiscard]] std::filesystem::path lock_of(const std::filesystem::path& run_folder);
[[nodiscard]] std::filesystem::path results_in(const std::filesystem::path& work);
[[nodiscard]] std::filesystem::path placed_file(const std::filesystem::path& work);

// Whether the folder holds a mapping run that `--resume` goes on with.
[[nodiscard]] bool holds_unfinished_run(const std::filesystem::path& run_folder);
// The command that goes on with it, as a user types it.
[[nodiscard]] std::string resume_command(const std::filesystem::path& run_folder);

// OutputError if the folder holds a work folder that is not of this program, or of a newer version.
void refuse_foreign_work(const std::filesystem::path& run_folder);
// The same for who only reads there: InputError if a newer version of the program is at work in it.
void refuse_newer_work(const std::filesystem::path& run_folder);

// Writes the marker if there is none. Throws OutputError.
void leave_marker(const std::filesystem::path& work);

// Each removes what its name says, as far as it can be removed: what is left over harms nobody.
void clear_results(const std::filesystem::path& work);  // and tiles
void clear_state(const std::filesystem::path& work);
void remove_work_folder(const std::filesystem::path& work);

}  // namespace understory
