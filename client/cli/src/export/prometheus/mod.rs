//! `residual export prometheus`: a small HTTP server beside the daemon, which it only reads.

mod classic;
mod help;
mod metrics;

use std::io::Cursor;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4};
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::Args;
use residual_client::{Instance, InstanceName};
use tiny_http::{Header, Method, Request, Response, Server};

use crate::error::Error;
use crate::{instances, until};

/// The older text format, for whoever does not ask for OpenMetrics: `curl`, and tools that know no other.
const CLASSIC: &str = "text/plain; version=0.0.4; charset=utf-8";

/// The text format of `prometheus-client`, which Prometheus asks for.
const OPENMETRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Where Prometheus finds the exporter unless told otherwise: this machine only.
const DEFAULT_ADDRESS: SocketAddr = SocketAddr::V4(SocketAddrV4::new(Ipv4Addr::LOCALHOST, 9477));

/// How soon a signal ends the server.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Whom to answer, about what.
#[derive(Debug, Args)]
pub struct PrometheusArguments {
    /// Name of the instance; may be left out if there is only one.
    #[arg(long, value_name = "NAME")]
    instance: Option<InstanceName>,
    /// Address and port of the server. Whoever can reach it reads everything: there is no password and no encryption.
    /// Port 0: any free one.
    #[arg(long, value_name = "ADDRESS:PORT", default_value_t = DEFAULT_ADDRESS)]
    listen: SocketAddr,
}

/// Answers until told to end.
pub fn run(arguments: &PrometheusArguments, runtime_directory: &Path) -> Result<u8, Error> {
    let stop = until::stop_flag().map_err(Error::Signals)?;
    let instance = instances::choose(arguments.instance.as_ref(), runtime_directory)?;
    let address = arguments.listen;
    let server = Server::http(address).map_err(|reason| Error::Listen {
        address,
        reason: reason.to_string(),
    })?;
    eprintln!(
        "metrics of {} on http://{}/metrics",
        instance.name,
        server.server_addr()
    );
    let path = instance.bounds_path();
    if !path.exists() {
        eprintln!(
            "residual: there is no table {} yet: residual_up is 0 until the daemon runs{}",
            path.display(),
            instances::hint(runtime_directory)
        );
    }
    while !stop.load(Ordering::Relaxed) {
        // A connection that fails is its client's matter.
        if let Ok(Some(request)) = server.recv_timeout(LOOK_PERIOD) {
            let response = answer(&request, &instance);
            let _ = request.respond(response);
        }
    }
    Ok(0)
}

fn answer(request: &Request, instance: &Instance) -> Response<Cursor<Vec<u8>>> {
    let path = request.url().split('?').next().unwrap_or_default();
    match (request.method(), path) {
        (Method::Get | Method::Head, "/metrics") => match metrics::text(instance) {
            Ok(text) => {
                let (text, content_type) = if wants_openmetrics(request) {
                    (text, OPENMETRICS)
                } else {
                    (classic::text(&text), CLASSIC)
                };
                let response = Response::from_string(text);
                match Header::from_bytes("Content-Type", content_type) {
                    Ok(header) => response.with_header(header),
                    Err(()) => response,
                }
            }
            Err(error) => Response::from_string(format!("{error}\n")).with_status_code(500),
        },
        (Method::Get | Method::Head, _) => {
            Response::from_string("the metrics are at /metrics\n").with_status_code(404)
        }
        _ => Response::from_string("only GET and HEAD are answered\n").with_status_code(405),
    }
}

fn wants_openmetrics(request: &Request) -> bool {
    let mut accepted = request
        .headers()
        .iter()
        .filter(|header| header.field.equiv("Accept"));
    accepted.any(|header| header.value.as_str().contains("application/openmetrics-text"))
}
