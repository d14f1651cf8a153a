//! The terminal while it is drawn on, and its restoration.

use std::io::{self, BufWriter, Stdout, Write};
use std::panic;
use std::sync::Once;

use ratatui::backend::{Backend, CrosstermBackend};
use ratatui::buffer::Buffer;
use ratatui::crossterm::{cursor, execute, terminal};
use ratatui::layout::Rect;
use ratatui::{Terminal, TerminalOptions, Viewport};

use super::state::ViewState;
use super::view;

/// Assumed size of a terminal that does not know its own.
const UNKNOWN_SIZE: Rect = Rect::new(0, 0, 80, 24);

/// The terminal in the state for drawing; restored when dropped, by an error or a panic too.
pub struct Screen {
    terminal: Terminal<CrosstermBackend<BufWriter<Stdout>>>,
    size: Rect,
    /// What the terminal shows.
    shown: Buffer,
}

impl Screen {
    /// Takes the terminal of the standard output.
    pub fn take() -> io::Result<Self> {
        static HOOK: Once = Once::new();
        // The message of a panic is for the terminal's ordinary screen.
        HOOK.call_once(|| {
            let report = panic::take_hook();
            panic::set_hook(Box::new(move |panic| {
                restore();
                report(panic);
            }));
        });
        terminal::enable_raw_mode()?;
        let size = size();
        let viewport = Viewport::Fixed(size);
        // A view is one write.
        let output = BufWriter::with_capacity(1 << 16, io::stdout());
        let taken = execute!(
            io::stdout(),
            terminal::EnterAlternateScreen,
            terminal::DisableLineWrap,
            cursor::Hide
        )
        .and_then(|()| Terminal::with_options(CrosstermBackend::new(output), TerminalOptions { viewport }));
        match taken {
            Ok(terminal) => Ok(Self {
                terminal,
                size,
                shown: Buffer::empty(Rect::ZERO),
            }),
            Err(error) => {
                restore();
                Err(error)
            }
        }
    }

    /// Whether the terminal has got another size since it was last drawn on.
    pub fn is_resized(&self) -> bool {
        size() != self.size
    }

    /// Forgets what the terminal shows: it may have lost it.
    pub fn forget(&mut self) {
        self.size = Rect::ZERO;
    }

    /// Draws the view: writes the cells that changed, and nothing at all if none did.
    pub fn draw(&mut self, state: &ViewState) -> io::Result<()> {
        let size = size();
        if size != self.size {
            self.size = size;
            self.terminal.resize(size)?;
            self.shown = Buffer::empty(Rect::ZERO);
        }
        self.terminal.current_buffer_mut().reset();
        view::draw(&mut self.terminal.get_frame(), state);
        if *self.terminal.current_buffer_mut() == self.shown {
            return Ok(());
        }
        self.shown.clone_from(self.terminal.current_buffer_mut());
        self.terminal.flush()?;
        self.terminal.swap_buffers();
        Backend::flush(self.terminal.backend_mut())
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        restore();
    }
}

/// The size of the terminal that is written to.
fn size() -> Rect {
    match rustix::termios::tcgetwinsize(rustix::stdio::stdout()) {
        Ok(size) if size.ws_col > 0 && size.ws_row > 0 => Rect::new(0, 0, size.ws_col, size.ws_row),
        _ => UNKNOWN_SIZE,
    }
}

fn restore() {
    let mut output = io::stdout();
    // A terminal that has gone away cannot be restored.
    let _ = execute!(
        output,
        cursor::Show,
        terminal::EnableLineWrap,
        terminal::LeaveAlternateScreen
    );
    let _ = terminal::disable_raw_mode();
    let _ = output.flush();
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Read;
    use std::process::{Command, Stdio};

    use nix::pty::openpty;
    use nix::sys::termios::tcgetattr;

    use super::*;

    #[test]
    #[ignore = "runs on a terminal of its own, in the test below"]
    #[should_panic]
    fn panics_while_it_has_the_terminal() {
        let _screen = Screen::take().unwrap();
        panic!("out of order");
    }

    #[test]
    fn a_panic_is_reported_on_the_restored_terminal() {
        let pair = openpty(None, None).unwrap();
        let before = tcgetattr(&pair.slave).unwrap();
        let side = || Stdio::from(pair.slave.try_clone().unwrap());
        let test = "watch::screen::tests::panics_while_it_has_the_terminal";
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args([test, "--exact", "--ignored", "--nocapture", "--test-threads=1"]);
        let mut child = command
            .stdin(side())
            .stdout(side())
            .stderr(side())
            .spawn()
            .unwrap();
        drop(command);
        let (mut master, mut drawn) = (File::from(pair.master), Vec::new());
        let mut chunk = [0; 4096];
        while !String::from_utf8_lossy(&drawn).contains("test result: ok") {
            let count = master.read(&mut chunk).unwrap();
            drawn.extend_from_slice(&chunk[..count]);
        }
        assert!(child.wait().unwrap().success());
        assert_eq!(tcgetattr(&pair.slave).unwrap(), before);
        let drawn = String::from_utf8_lossy(&drawn);
        let place = |part: &str| drawn.find(part).unwrap_or_else(|| panic!("{part:?}: {drawn}"));
        assert!(place("\x1b[?1049h") < place("\x1b[?1049l"));
        assert!(place("\x1b[?1049l") < place("out of order"), "{drawn}");
    }
}
