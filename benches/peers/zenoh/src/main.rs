//! Round trips of zenoh messages between two processes, as zenoh's own examples `z_ping` and `z_pong` do them: peers,
//! one TCP connection over the loopback interface, express messages, the answer sent from the callback.
//!
//! `zenoh-latency pong PORT` answers until its standard input is closed. `zenoh-latency ping PORT BYTES COUNT WARM`
//! prints COUNT round-trip times in nanoseconds as one JSON list.

use std::io::{Read, Write};
use std::time::Instant;

use zenoh::qos::CongestionControl;
use zenoh::{Config, Session, Wait};

type Failure = Box<dyn std::error::Error + Send + Sync>;

const PING: &str = "residuald/ping";
const PONG: &str = "residuald/pong";

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        ["pong", port] => pong(port),
        ["ping", port, bytes, count, warm] => ping(port, bytes.parse()?, count.parse()?, warm.parse()?),
        _ => Err("usage: zenoh-latency pong PORT | ping PORT BYTES COUNT WARM".into()),
    }
}

fn open(role: &str, port: &str) -> Result<Session, Failure> {
    let mut config = Config::default();
    config.insert_json5("mode", "\"peer\"")?;
    config.insert_json5("scouting/multicast/enabled", "false")?;
    config.insert_json5(
        &format!("{role}/endpoints"),
        &format!("[\"tcp/127.0.0.1:{port}\"]"),
    )?;
    if role == "connect" {
        config.insert_json5("listen/endpoints", "[]")?;
    }
    zenoh::open(config).wait()
}

fn pong(port: &str) -> Result<(), Failure> {
    let session = open("listen", port)?;
    let publisher = session
        .declare_publisher(PONG)
        .congestion_control(CongestionControl::Block)
        .express(true)
        .wait()?;
    let _subscriber = session
        .declare_subscriber(PING)
        .callback(move |sample| {
            // The other side has gone, or the next message arrives.
            let _ = publisher.put(sample.payload().clone()).wait();
        })
        .wait()?;
    println!("ready");
    std::io::stdout().flush()?;
    std::io::stdin().read_to_end(&mut Vec::new())?;
    Ok(())
}

fn ping(port: &str, bytes: usize, count: usize, warm: usize) -> Result<(), Failure> {
    let session = open("connect", port)?;
    let subscriber = session.declare_subscriber(PONG).wait()?;
    let publisher = session
        .declare_publisher(PING)
        .congestion_control(CongestionControl::Block)
        .express(true)
        .wait()?;
    while !publisher.matching_status().wait()?.matching() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let payload = vec![0x5A_u8; bytes];
    let mut times = Vec::with_capacity(count);
    for round in 0..warm + count {
        let begin = Instant::now();
        publisher.put(payload.clone()).wait()?;
        let answer = subscriber.recv()?;
        let time = begin.elapsed().as_nanos();
        if answer.payload().len() != bytes {
            return Err("the answer has another length".into());
        }
        if round >= warm {
            times.push(time.to_string());
        }
    }
    println!("[{}]", times.join(","));
    Ok(())
}
