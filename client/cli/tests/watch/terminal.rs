//! A terminal of its own for `residual watch`: what it shows, its keys, its size.

use std::fs::File;
use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::os::fd::AsFd;
use std::os::unix::fs::OpenOptionsExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::signal::{Signal, kill};
use nix::sys::termios::{Termios, tcgetattr};
use nix::unistd::Pid;
use rustix::fs::OFlags;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use vt100::Parser;

/// Longest wait for anything, on a machine however busy.
const PATIENCE: Duration = Duration::from_secs(20);

/// So long without a byte, and a view is complete.
const QUIET_MS: u16 = 60;

pub struct Terminal {
    master: File,
    slave: File,
    before: Termios,
    child: Child,
    parser: Parser,
}

impl Terminal {
    /// Starts the command on a terminal of so many columns and rows.
    pub fn start(mut command: Command, size: (u16, u16)) -> Self {
        let (master, slave) = open_pair();
        let before = tcgetattr(&slave).unwrap();
        set_size(&slave, size);
        let side = || Stdio::from(slave.try_clone().unwrap());
        let child = command
            .stdin(side())
            .stdout(side())
            .stderr(side())
            .spawn()
            .unwrap();
        let (columns, rows) = shown_size(size);
        Self {
            master,
            slave,
            before,
            child,
            parser: Parser::new(rows, columns, 0),
        }
    }

    /// Types.
    pub fn press(&mut self, keys: &str) {
        self.master.write_all(keys.as_bytes()).unwrap();
    }

    /// Gives the terminal another size, as a window manager does.
    pub fn resize(&mut self, size: (u16, u16)) {
        self.settle();
        set_size(&self.slave, size);
        let (columns, rows) = shown_size(size);
        self.parser.screen_mut().set_size(rows, columns);
        self.signal(Signal::SIGWINCH);
    }

    /// Hangs up, as a lost connection does, and waits for the end.
    pub fn hang_up(&mut self) -> ExitStatus {
        drop(std::mem::replace(
            &mut self.master,
            File::open("/dev/null").unwrap(),
        ));
        let deadline = Instant::now() + PATIENCE;
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(Instant::now() < deadline, "it goes on without a terminal");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    pub fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(self.child.id() as i32), signal).unwrap();
    }

    /// What is shown, without blanks at the ends of lines.
    pub fn text(&self) -> String {
        let screen = self.parser.screen();
        let width = screen.size().1.get();
        let rows: Vec<_> = screen
            .rows(0, width)
            .map(|row| row.trim_end().to_owned())
            .collect();
        rows.join("\n")
    }

    /// Whether any character has a colour.
    pub fn has_colour(&self) -> bool {
        let screen = self.parser.screen();
        let (rows, columns) = screen.size();
        let cells = (0..rows.get()).flat_map(|row| (0..columns.get()).map(move |column| (row, column)));
        cells
            .filter_map(|(row, column)| screen.cell(row, column))
            .any(|cell| cell.fgcolor() != vt100::Color::Default || cell.bgcolor() != vt100::Color::Default)
    }

    /// Waits until all these words are shown, however far apart, and the view is complete.
    pub fn wait_for(&mut self, words: &[&str]) -> String {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let is_shown = |text: &str| {
                let squeezed = text.split_whitespace().collect::<Vec<_>>().join(" ");
                words.iter().all(|word| squeezed.contains(word))
            };
            if is_shown(&self.text()) {
                // The view is complete when it comes to rest.
                self.settle();
                let text = self.text();
                if is_shown(&text) {
                    return text;
                }
            }
            assert!(
                Instant::now() < deadline,
                "{words:?} never appeared:\n{}",
                self.text()
            );
            self.receive(20);
        }
    }

    /// Receives until nothing comes any more; tells how many bytes came.
    pub fn settle(&mut self) -> usize {
        let mut count = 0;
        loop {
            match self.receive(QUIET_MS) {
                0 => return count,
                more => count += more,
            }
        }
    }

    /// Waits for the end; checks that the terminal is as it was before.
    pub fn end(&mut self) -> ExitStatus {
        let deadline = Instant::now() + PATIENCE;
        let status = loop {
            self.receive(10);
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            assert!(Instant::now() < deadline, "it does not end:\n{}", self.text());
        };
        self.settle();
        let screen = self.parser.screen();
        assert!(!screen.alternate_screen(), "the alternate screen was not left");
        assert!(!screen.hide_cursor(), "the cursor is still hidden");
        assert_eq!(
            tcgetattr(&self.slave).unwrap(),
            self.before,
            "the modes were not restored"
        );
        status
    }

    /// Takes what comes within the time; gives the number of bytes.
    fn receive(&mut self, timeout_ms: u16) -> usize {
        let mut ready = [PollFd::new(self.master.as_fd(), PollFlags::POLLIN)];
        if poll(&mut ready, PollTimeout::from(timeout_ms)).unwrap() == 0 {
            return 0;
        }
        let mut chunk = [0; 65_536];
        let count = self.master.read(&mut chunk).unwrap();
        self.parser.process(&chunk[..count]);
        count
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Both sides of a terminal, neither of which a child inherits: a side that stays open somewhere never hangs up.
fn open_pair() -> (File, File) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let name = ptsname(&master, Vec::new()).unwrap();
    let slave = File::options()
        .read(true)
        .write(true)
        .custom_flags(OFlags::NOCTTY.bits() as i32)
        .open(name.to_str().unwrap())
        .unwrap();
    (File::from(master), slave)
}

fn set_size(slave: &File, (columns, rows): (u16, u16)) {
    let size = Winsize {
        ws_row: rows,
        ws_col: columns,
        ws_xpixel: 0,
        ws_ypixel: 0,
    };
    tcsetwinsize(slave, size).unwrap();
}

/// A terminal that does not know its size shows 80 columns and 24 rows.
fn shown_size((columns, rows): (u16, u16)) -> (NonZeroU16, NonZeroU16) {
    match (NonZeroU16::new(columns), NonZeroU16::new(rows)) {
        (Some(columns), Some(rows)) => (columns, rows),
        _ => (NonZeroU16::new(80).unwrap(), NonZeroU16::new(24).unwrap()),
    }
}
