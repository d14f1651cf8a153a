//! Hears alarms in the ring and notifies the iceoryx2 event, as the daemon's companion thread does.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::{Context, Result, anyhow};
use residual_shared::bounds_table::{AlarmRead, TableReader};
use residual_shared::names::Instance;
use residual_shared::transport::{self, AlarmNotifier};

/// The running relay.
pub struct Relay {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Result<()>>,
}

impl Relay {
    /// Starts it; the event's service is there when this returns.
    pub fn start(instance: Instance) -> Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&stop);
        let (ready, is_ready) = sync_channel(1);
        let thread = std::thread::spawn(move || {
            // iceoryx2's ports belong to one thread, so they are made here.
            let node = transport::open_node(&instance)?;
            let notifier = AlarmNotifier::create(&node, &instance)?;
            let table = TableReader::open(&instance.bounds_path())?;
            ready.send(())?;
            relay(&table, &notifier, &told)
        });
        if is_ready.recv().is_err() {
            let outcome = thread.join().map_err(|_| anyhow!("the relay failed"))?;
            outcome.context("the relay")?;
            return Err(anyhow!("the relay ended"));
        }
        Ok(Self { stop, thread })
    }

    /// Ends it.
    pub fn end(self) -> Result<()> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().map_err(|_| anyhow!("the relay failed"))?
    }
}

fn relay(table: &TableReader, notifier: &AlarmNotifier, stop: &AtomicBool) -> Result<()> {
    let mut seen = 0;
    while !stop.load(Ordering::Relaxed) {
        table.wait_for_alarm(seen, Duration::from_millis(5));
        while let AlarmRead::Transition(transition) = table.read_alarm(seen + 1) {
            seen += 1;
            notifier.notify(transition.state)?;
        }
    }
    Ok(())
}
