//! The page over HTTP, drawn anew as the runs go on.
//!
//! One request at a time and only to read; on loopback it answers only those who asked for loopback, so that no other
//! page in the browser can read it by a name of its own.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{IpAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context as _;

use crate::interrupt;

/// A request's head may be this long.
const HEAD: u64 = 8192;
const PATIENCE: Duration = Duration::from_secs(2);
const GLANCE: Duration = Duration::from_millis(50);

/// Reloads the page when a run has moved on; keeps the place on it.
const SCRIPT: &str = "<script>
let seen = null;
setInterval(async () => {
  try {
    const now = await (await fetch('/version')).text();
    if (seen !== null && now !== seen) {
      sessionStorage.setItem('y', scrollY);
      location.reload();
    }
    seen = now;
  } catch (e) { document.title = '(offline) ' + document.title.replace('(offline) ', ''); }
}, 3000);
addEventListener('load', () => scrollTo(0, sessionStorage.getItem('y') || 0));
</script>";

/// Serves until Ctrl-C.
pub(super) fn serve(runs: &[PathBuf], address: IpAddr, port: u16) -> anyhow::Result<()> {
    // Whether there is anything to show is said now, not to a browser.
    super::render(runs)?;
    let listener = TcpListener::bind((address, port))
        .with_context(|| format!("cannot listen on {address}:{port}; try another --port"))?;
    listener.set_nonblocking(true)?;
    let place = listener.local_addr()?;
    writeln!(std::io::stdout(), "http://{place}/ shows the runs as they go on; Ctrl-C ends it")?;
    let mut server = Server { runs, loopback: place.ip().is_loopback(), page: None };
    while !interrupt::requested() {
        match listener.accept() {
            Ok((stream, _)) => {
                if let Err(e) = server.answer(&stream) {
                    tracing::debug!(error = %e, "a request failed");
                }
            }
            Err(e) if e.kind() == std::io::ErrorKind::WouldBlock => std::thread::sleep(GLANCE),
            Err(e) => return Err(e).context("cannot take connections"),
        }
    }
    Ok(())
}

struct Server<'a> {
    runs: &'a [PathBuf],
    loopback: bool,
    /// Version and page.
    page: Option<(String, String)>,
}

impl Server<'_> {
    fn answer(&mut self, stream: &TcpStream) -> anyhow::Result<()> {
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        let mut lines = BufReader::new(stream.take(HEAD)).lines();
        let request = lines.next().context("nothing asked")??;
        let mut host = String::new();
        for line in lines {
            let line = line?;
            if line.is_empty() {
                break;
            }
            if let Some((name, value)) = line.split_once(':')
                && name.eq_ignore_ascii_case("host")
            {
                value.trim().clone_into(&mut host);
            }
        }
        let (status, kind, body) = self.respond(&request, &host);
        let head = format!(
            "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {}\r\n\
             Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
            body.len()
        );
        let mut stream = stream;
        stream.write_all(head.as_bytes())?;
        stream.write_all(body.as_bytes())?;
        Ok(())
    }

    /// Status, type and body for a request line and the host it was meant for.
    fn respond(&mut self, request: &str, host: &str) -> (&'static str, &'static str, String) {
        if self.loopback && !is_loopback(host) {
            let why = "this page is for this machine only; see --address".to_owned();
            return ("403 Forbidden", "text/plain", why);
        }
        let mut words = request.split_whitespace();
        match (words.next(), words.next()) {
            (Some("GET"), Some("/version")) => ("200 OK", "text/plain", super::version(self.runs)),
            (Some("GET"), Some("/")) => match self.page() {
                Ok(page) => ("200 OK", "text/html", page),
                Err(e) => ("500 Internal Server Error", "text/plain", format!("{e:#}")),
            },
            (Some("GET"), _) => ("404 Not Found", "text/plain", "there is only /".into()),
            _ => ("405 Method Not Allowed", "text/plain", "only GET".into()),
        }
    }

    fn page(&mut self) -> anyhow::Result<String> {
        let now = super::version(self.runs);
        if let Some((version, page)) = &self.page
            && *version == now
        {
            return Ok(page.clone());
        }
        let page = super::render(self.runs)?.replacen("</head>", &format!("{SCRIPT}</head>"), 1);
        self.page = Some((now, page.clone()));
        Ok(page)
    }
}

/// Whether a Host header names this machine, with or without a port.
fn is_loopback(host: &str) -> bool {
    let name = host
        .strip_prefix('[')
        .and_then(|h| h.split_once(']'))
        .map_or_else(|| host.rsplit_once(':').map_or(host, |(name, _)| name), |(name, _)| name);
    name == "localhost" || name.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_this_machine_is_answered_and_only_what_there_is() {
        let runs = vec![PathBuf::from("no-such-run")];
        let mut server = Server { runs: &runs, loopback: true, page: None };
        let mut status = |request, host| server.respond(request, host).0[..3].to_owned();
        assert_eq!(status("GET /version HTTP/1.1", "127.0.0.1:8642"), "200");
        assert_eq!(status("GET /version HTTP/1.1", "localhost"), "200");
        assert_eq!(status("GET /version HTTP/1.1", "[::1]:80"), "200");
        assert_eq!(status("GET /version HTTP/1.1", "evil.example"), "403");
        assert_eq!(status("GET /version HTTP/1.1", ""), "403");
        assert_eq!(status("GET /etc/passwd HTTP/1.1", "localhost"), "404");
        assert_eq!(status("POST / HTTP/1.1", "localhost"), "405");
        assert_eq!(status("GET / HTTP/1.1", "localhost"), "500", "there is no such run");
        assert_eq!(status("", "localhost"), "405");
    }
}
