// A library to preload into a program. It writes down every system call by which the program
// changes files below one folder, with the bytes. tests/durability/disk.py then tells what a disk
// may hold after a power cut at any moment.
//
// It does not replace functions of the C library. stdio, the C++ streams, GDAL and SQLite call the
// kernel from inside of libraries, past any function of the same name. Instead a seccomp filter
// makes the kernel stop at these system calls, whoever makes them. A signal handler here gets them,
// makes each call itself and notes what came of it.
//
// UNDERSTORY_POWER_CUT_FOLDER   what lies below is watched (absolute, without symbolic links)
// UNDERSTORY_POWER_CUT_LOG      the log, begun anew
//
// Linux on x86-64 only. A preloaded library has no other place for its state than globals.

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/fs.h>
#include <linux/seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <ucontext.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string_view>

// The only place from which the filter lets these calls pass.
extern "C" long power_cut_call(long number, long a, long b, long c, long d, long e, long f);
extern "C" const char power_cut_call_done[];
asm(R"(
  .text
  .globl power_cut_call
  .type power_cut_call, @function
power_cut_call:
  movq %rdi, %rax
  movq %rsi, %rdi
  movq %rdx, %rsi
  movq %rcx, %rdx
  movq %r8, %r10
  movq %r9, %r8
  movq 8(%rsp), %r9
  syscall
  .globl power_cut_call_done
power_cut_call_done:
  ret
  .size power_cut_call, .-power_cut_call
)");

namespace {

enum class Kind : std::uint32_t {
  kMake = 1,      // path, inode: a new file
  kWrite = 2,     // inode, offset, bytes
  kTruncate = 3,  // inode, offset: the new size
  kRename = 4,    // path, second path
  kRemove = 5,    // path
  kFolder = 6,    // path: a new folder
  kSync = 7,      // inode of a file, or path of a folder; offset: nanoseconds that it took
  kSyncAll = 8,
  kUnknown = 9,  // path: changed in a way that is not followed here; offset: the system call
};

struct Head {
  Kind kind = Kind::kUnknown;
  std::uint32_t path = 0;  // lengths
  std::uint32_t second = 0;
  std::uint32_t spare = 0;
  std::uint64_t inode = 0;
  std::int64_t offset = 0;
  std::uint64_t bytes = 0;
};

using Path = std::array<char, PATH_MAX>;

Path watched{};
std::size_t watched_length = 0;
long log_file = -1;
std::atomic_flag busy = ATOMIC_FLAG_INIT;

template <typename... Arguments>
long call(long number, Arguments... arguments) {
  std::array<long, 6> a{};
  std::size_t i = 0;
  ((a[i++] = (long)(arguments)), ...);
  return power_cut_call(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

void write_all(const void* bytes, std::size_t count) {
  const char* at = static_cast<const char*>(bytes);
  while (count > 0) {
    const long written = call(SYS_write, log_file, at, count);
    if (written == -EINTR) continue;
    if (written <= 0) call(SYS_exit_group, 99);
    at += written;
    count -= static_cast<std::size_t>(written);
  }
}

void note(Kind kind, const char* path, const char* second, std::uint64_t inode, std::int64_t offset,
          const iovec* parts = nullptr, std::uint64_t bytes = 0) {
  const Head head{kind,
                  path == nullptr ? 0 : static_cast<std::uint32_t>(std::strlen(path)),
                  second == nullptr ? 0 : static_cast<std::uint32_t>(std::strlen(second)),
                  0,
                  inode,
                  offset,
                  bytes};
  write_all(&head, sizeof(head));
  if (path != nullptr) write_all(path, head.path);
  if (second != nullptr) write_all(second, head.second);
  for (std::uint64_t left = bytes; left > 0; ++parts) {
    const std::uint64_t part = left < parts->iov_len ? left : parts->iov_len;
    write_all(parts->iov_base, part);
    left -= part;
  }
}

bool is_watched(const Path& path) {
  return std::strncmp(path.data(), watched.data(), watched_length) == 0 &&
         (path[watched_length] == '/' || path[watched_length] == '\0');
}

// What a descriptor stands for; false if that lies elsewhere.
bool path_of(long file, Path& path) {
  std::array<char, 40> link{};
  std::snprintf(link.data(), link.size(), "/proc/self/fd/%ld", file);
  const long length = call(SYS_readlinkat, AT_FDCWD, link.data(), path.data(), path.size() - 1);
  path[length > 0 ? static_cast<std::size_t>(length) : 0] = '\0';
  return length > 0 && is_watched(path);
}

// A path as given, made absolute by its folder.
bool path_at(long folder, const char* given, Path& path) {
  if (given[0] == '/') {
    std::snprintf(path.data(), path.size(), "%s", given);
    return is_watched(path);
  }
  Path base{};
  if (static_cast<int>(folder) == AT_FDCWD) {
    const long length =
        call(SYS_readlinkat, AT_FDCWD, "/proc/self/cwd", base.data(), base.size() - 1);
    base[length > 0 ? static_cast<std::size_t>(length) : 0] = '\0';
  } else {
    (void)path_of(folder, base);
  }
  // NOLINTNEXTLINE: what does not fit is not watched
  if (std::snprintf(path.data(), path.size(), "%s/%s", base.data(), given) >= PATH_MAX)
    return false;
  return is_watched(path);
}

struct stat status_of(long file) {
  struct stat status {};
  call(SYS_fstat, file, &status);
  return status;
}

using Arguments = std::array<long, 6>;

long do_open(long number, long folder, const char* path, long flags, long mode, long how) {
  Path absolute{};
  const bool inside = path_at(folder, path, absolute);
  const bool existed = call(SYS_faccessat, folder, path, F_OK) == 0;
  const long file = number == SYS_openat2 ? call(number, folder, path, how, mode)
                                          : call(SYS_openat, folder, path, flags, mode);
  if (file < 0 || !inside) return file;
  const struct stat status = status_of(file);
  if (!S_ISREG(status.st_mode)) return file;
  if ((flags & O_TMPFILE) == O_TMPFILE) note(Kind::kUnknown, absolute.data(), nullptr, 0, number);
  if ((flags & O_CREAT) != 0 && !existed)
    note(Kind::kMake, absolute.data(), nullptr, status.st_ino, 0);
  if ((flags & O_TRUNC) != 0 && existed) note(Kind::kTruncate, nullptr, nullptr, status.st_ino, 0);
  return file;
}

long do_write(long number, const Arguments& a) {
  Path path{};
  const long file = a[0];
  const bool inside = path_of(file, path);
  const bool vector = number == SYS_writev || number == SYS_pwritev || number == SYS_pwritev2;
  const bool placed = number == SYS_pwrite64 || number == SYS_pwritev || number == SYS_pwritev2;
  std::int64_t offset = placed ? a[3] : 0;
  if (inside && (!placed || offset == -1)) {
    const bool append = (call(SYS_fcntl, file, F_GETFL) & O_APPEND) != 0;
    offset = append ? status_of(file).st_size : call(SYS_lseek, file, 0, SEEK_CUR);
  }
  const long written = call(number, a[0], a[1], a[2], a[3], a[4], a[5]);
  if (!inside || written <= 0) return written;
  const struct stat status = status_of(file);
  if (!S_ISREG(status.st_mode)) return written;
  const iovec one{reinterpret_cast<void*>(a[1]), static_cast<std::size_t>(a[2])};
  note(Kind::kWrite, nullptr, nullptr, status.st_ino, offset,
       vector ? reinterpret_cast<const iovec*>(a[1]) : &one, static_cast<std::uint64_t>(written));
  return written;
}

long do_rename(long number, long from_folder, const char* from, long to_folder, const char* to,
               long flags) {
  Path source{};
  Path target{};
  const bool inside = path_at(from_folder, from, source);
  const bool into = path_at(to_folder, to, target);
  const long result = call(SYS_renameat2, from_folder, from, to_folder, to, flags);
  if (result != 0 || (!inside && !into)) return result;
  const bool plain = inside && into && (flags & ~RENAME_NOREPLACE) == 0;
  note(plain ? Kind::kRename : Kind::kUnknown, source.data(), target.data(), 0, number);
  return result;
}

// Calls that change what a path stands for, which is noted where they succeed.
long do_path(Kind kind, long number, long folder, long path_argument, const Arguments& a) {
  Path path{};
  const bool inside = path_at(folder, reinterpret_cast<const char*>(path_argument), path);
  const long result = call(number, a[0], a[1], a[2], a[3], a[4], a[5]);
  if (result == 0 && inside) note(kind, path.data(), nullptr, 0, number);
  return result;
}

// Calls on an open file.
std::int64_t now_ns() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return time.tv_sec * 1'000'000'000 + time.tv_nsec;
}

long do_file(Kind kind, long number, std::int64_t offset, const Arguments& a) {
  Path path{};
  const bool inside = path_of(a[0], path);
  const std::int64_t begin = now_ns();
  const long result = call(number, a[0], a[1], a[2], a[3], a[4], a[5]);
  if (result < 0 || !inside) return result;
  if (kind == Kind::kSync) offset = now_ns() - begin;
  const struct stat status = status_of(a[0]);
  note(kind, S_ISDIR(status.st_mode) || kind == Kind::kUnknown ? path.data() : nullptr, nullptr,
       status.st_ino, offset);
  return result;
}

long dispatch(long number, const Arguments& a) {
  const auto path = [&](std::size_t i) { return reinterpret_cast<const char*>(a[i]); };
  switch (number) {
    case SYS_open:
      return do_open(number, AT_FDCWD, path(0), a[1], a[2], 0);
    case SYS_creat:
      return do_open(number, AT_FDCWD, path(0), O_CREAT | O_WRONLY | O_TRUNC, a[1], 0);
    case SYS_openat:
      return do_open(number, a[0], path(1), a[2], a[3], 0);
    case SYS_openat2:
      return do_open(number, a[0], path(1), *reinterpret_cast<const long*>(a[2]), a[3], a[2]);
    case SYS_write:
    case SYS_pwrite64:
    case SYS_writev:
    case SYS_pwritev:
    case SYS_pwritev2:
      return do_write(number, a);
    case SYS_rename:
      return do_rename(number, AT_FDCWD, path(0), AT_FDCWD, path(1), 0);
    case SYS_renameat:
      return do_rename(number, a[0], path(1), a[2], path(3), 0);
    case SYS_renameat2:
      return do_rename(number, a[0], path(1), a[2], path(3), a[4]);
    case SYS_unlink:
    case SYS_rmdir:
      return do_path(Kind::kRemove, number, AT_FDCWD, a[0], a);
    case SYS_unlinkat:
      return do_path(Kind::kRemove, number, a[0], a[1], a);
    case SYS_mkdir:
      return do_path(Kind::kFolder, number, AT_FDCWD, a[0], a);
    case SYS_mkdirat:
      return do_path(Kind::kFolder, number, a[0], a[1], a);
    case SYS_link:
    case SYS_symlink:
      return do_path(Kind::kUnknown, number, AT_FDCWD, a[1], a);
    case SYS_linkat:
      return do_path(Kind::kUnknown, number, a[2], a[3], a);
    case SYS_symlinkat:
      return do_path(Kind::kUnknown, number, a[1], a[2], a);
    case SYS_truncate:
      return do_path(Kind::kUnknown, number, AT_FDCWD, a[0], a);
    case SYS_ftruncate:
      return do_file(Kind::kTruncate, number, a[1], a);
    case SYS_fsync:
    case SYS_fdatasync:
      return do_file(Kind::kSync, number, 0, a);
    case SYS_sync:
    case SYS_syncfs: {
      const long result = call(number, a[0]);
      note(Kind::kSyncAll, nullptr, nullptr, 0, 0);
      return result;
    }
    case SYS_copy_file_range: {
      const Arguments target{a[2]};
      Path copied{};
      const long result = call(number, a[0], a[1], a[2], a[3], a[4], a[5]);
      if (result > 0 && path_of(target[0], copied))
        note(Kind::kUnknown, copied.data(), nullptr, 0, number);
      return result;
    }
    case SYS_mmap: {
      Path mapped{};
      const bool writes = (a[2] & PROT_WRITE) != 0 && static_cast<int>(a[4]) >= 0;
      const long result = call(number, a[0], a[1], a[2], a[3], a[4], a[5]);
      if (writes && path_of(a[4], mapped)) note(Kind::kUnknown, mapped.data(), nullptr, 0, number);
      return result;
    }
    default:  // fallocate, sendfile, splice, ioctl: on a file, the first argument
      return do_file(Kind::kUnknown, number, number, a);
  }
}

void on_call(int /*signal*/, siginfo_t* info, void* context) {
  auto* registers = static_cast<ucontext_t*>(context)->uc_mcontext.gregs;
  const Arguments arguments{registers[REG_RDI], registers[REG_RSI], registers[REG_RDX],
                            registers[REG_R10], registers[REG_R8],  registers[REG_R9]};
  while (busy.test_and_set(std::memory_order_acquire))
    call(SYS_sched_yield);
  registers[REG_RAX] = dispatch(info->si_syscall, arguments);
  busy.clear(std::memory_order_release);
}

constexpr std::array<std::uint32_t, 33> kCalls = {
    SYS_open,          SYS_creat,    SYS_openat,    SYS_openat2,
    SYS_write,         SYS_pwrite64, SYS_writev,    SYS_pwritev,
    SYS_pwritev2,      SYS_rename,   SYS_renameat,  SYS_renameat2,
    SYS_unlink,        SYS_rmdir,    SYS_unlinkat,  SYS_mkdir,
    SYS_mkdirat,       SYS_link,     SYS_symlink,   SYS_linkat,
    SYS_symlinkat,     SYS_truncate, SYS_ftruncate, SYS_fsync,
    SYS_fdatasync,     SYS_sync,     SYS_syncfs,    SYS_copy_file_range,
    SYS_fallocate,     SYS_sendfile, SYS_splice,    SYS_mmap,
    SYS_io_uring_setup};

bool install_filter() {
  const auto done = reinterpret_cast<std::uint64_t>(power_cut_call_done);
  std::array<sock_filter, kCalls.size() + 16> code{};
  std::size_t n = 0;
  const auto add = [&](sock_filter each) { code[n++] = each; };
  const auto load = [&](std::size_t offset) {
    add(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset)));
  };
  const auto allow = [&] { add(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)); };
  load(offsetof(seccomp_data, arch));
  add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, AUDIT_ARCH_X86_64, 1, 0));
  allow();
  load(offsetof(seccomp_data, nr));
  for (std::size_t i = 0; i < kCalls.size(); ++i) {
    const auto to_end = static_cast<std::uint8_t>(kCalls.size() - i);
    add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kCalls[i], to_end, 0));
  }
  allow();
  // Private mappings change no file.
  add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_mmap, 0, 3));
  load(offsetof(seccomp_data, args[3]));
  add(BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, MAP_SHARED, 1, 0));
  allow();
  load(offsetof(seccomp_data, instruction_pointer));
  add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(done), 0, 3));
  load(offsetof(seccomp_data, instruction_pointer) + 4);
  add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(done >> 32U), 0, 1));
  allow();
  add(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP));
  const sock_fprog program{static_cast<unsigned short>(n), code.data()};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &program) == 0;
}

__attribute__((constructor)) void begin() {
  const char* folder = std::getenv("UNDERSTORY_POWER_CUT_FOLDER");
  const char* log = std::getenv("UNDERSTORY_POWER_CUT_LOG");
  if (folder == nullptr || log == nullptr) return;
  watched_length = std::strlen(folder);
  std::snprintf(watched.data(), watched.size(), "%s", folder);
  const long opened =
      call(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0644);
  log_file = call(SYS_fcntl, opened, F_DUPFD_CLOEXEC, 200);
  struct sigaction action {};
  action.sa_sigaction = on_call;
  action.sa_flags = SA_SIGINFO | SA_NODEFER | SA_RESTART;
  sigfillset(&action.sa_mask);
  if (log_file < 0 || sigaction(SIGSYS, &action, nullptr) != 0 || !install_filter()) {
    std::fprintf(stderr, "power cut: cannot watch the system calls: %s\n", std::strerror(errno));
    std::_Exit(98);
  }
}

}  // namespace
