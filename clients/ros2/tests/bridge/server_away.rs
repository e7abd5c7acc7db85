//! A server that goes away while a robot touches: what was reported arrives later, in order, once.

use std::time::Instant;

use palpate_client::proto::v1::contact_result::Outcome;
use palpate_ros2::bridge::{Bridge, Inbound};
use palpate_ros2::diagnostics::Level;
use palpate_ros2::driver::{Update, drive};
use palpate_ros2::messages::{Contact, Point, Pose, kind};
use palpate_ros2::outbox::{Command, Outbox};
use tokio::sync::mpsc;
use tokio::time::timeout;

use crate::harness::{LONG, Server};
use crate::robot::{CENTER, MS, RADIUS, camera, cloud, header};

struct Running {
    bridge: Bridge,
    updates: mpsc::Receiver<Update>,
}

impl Running {
    fn start(server: &Server, yaml: &[(&str, &str)]) -> Self {
        let parameters = server.parameters(yaml);
        let (outbox, orders) = Outbox::new(parameters.outbox_limit);
        let (tell, updates) = mpsc::channel(64);
        tokio::spawn(drive(parameters.clone(), orders, tell));
        Self { bridge: Bridge::new(parameters, outbox, "palpate"), updates }
    }

    /// Goes on until an update is the one that is looked for.
    async fn until(&mut self, what: &str, is_it: impl Fn(&Update) -> bool) {
        let found = timeout(LONG, async {
            loop {
                let update = self.updates.recv().await.expect("the driver goes on");
                let is_found = is_it(&update);
                self.bridge.update(update);
                if is_found {
                    return;
                }
            }
        });
        let is_late = found.await.is_err();
        assert!(!is_late, "no {what}; diagnostics: {:?}", self.bridge.diagnostics());
    }

    /// A touch on top of the ball, from who detects without the bridge.
    fn touch(&mut self, number: i64) {
        let contact = Contact {
            header: header("base", number * 1000 * MS),
            kind: kind::CONTACT,
            candidate_id: "none".to_owned(),
            has_pose: true,
            pose: Pose {
                position: Point { x: CENTER[0], y: CENTER[1], z: CENTER[2] + RADIUS + 1e-6 * number as f64 },
                orientation: palpate_ros2::messages::Quaternion { x: 1.0, y: 0.0, z: 0.0, w: 0.0 },
            },
            has_uncertainty: true,
            uncertainty: 0.1,
            ..Contact::default()
        };
        self.bridge.take(Inbound::Contact(contact), Instant::now());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn touches_while_the_server_is_away_are_in_the_log_once_and_in_order() {
    let server = Server::start().await;
    let mut running =
        Running::start(&server, &[("session_id", "away-1"), ("config", "{method: METHOD_PAPER}")]);
    running.until("session", |update| matches!(update, Update::Opened(_))).await;
    running.bridge.take(Inbound::TfStatic(camera()), Instant::now());
    running.bridge.take(Inbound::Cloud(cloud(500 * MS)), Instant::now());
    running.until("view", |update| matches!(update, Update::View(Ok(_)))).await;

    let stopped = server.stop().await;
    for number in 1..=4 {
        running.touch(number);
    }
    running.until("loss", |update| matches!(update, Update::Server(Err(_)))).await;
    let (level, said) = running.bridge.diagnostics().get("server").unwrap();
    assert!(level == Level::Error && said.contains("kept"), "{said}");

    let server = stopped.start().await;
    for _ in 0..4 {
        running.until("report", |update| matches!(update, Update::Report(Ok(_)))).await;
    }
    let results = server.results("away-1").await;
    let seconds: Vec<_> = results.iter().map(|result| result.observe_time.unwrap().seconds).collect();
    assert_eq!(seconds, [1, 2, 3, 4]);
    assert!(results.iter().all(|result| matches!(result.outcome, Some(Outcome::Contact(_)))));
    assert_eq!(running.bridge.diagnostics().get("server"), Some((Level::Ok, "answers")));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_touch_waits_for_a_new_token_where_the_old_one_is_not_taken_any_more() {
    let (server, [old, new]) = Server::start_with_tokens().await;
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), &old).unwrap();
    let token_file = file.path().to_str().unwrap();
    let mut running = Running::start(&server, &[("session_id", "tokens-1"), ("token_file", token_file)]);
    running.until("session", |update| matches!(update, Update::Opened(_))).await;
    running.bridge.take(Inbound::TfStatic(camera()), Instant::now());
    running.bridge.take(Inbound::Cloud(cloud(500 * MS)), Instant::now());
    running.until("view", |update| matches!(update, Update::View(Ok(_)))).await;

    server.revoke_old().await;
    let is_refused =
        |update: &Update| matches!(update, Update::Server(Err(why)) if why.contains("TOKEN_INVALID"));
    running.until("refusal", is_refused).await;
    running.touch(1);
    running.until("refusal", is_refused).await;
    std::fs::write(file.path(), &new).unwrap();
    running.until("report", |update| matches!(update, Update::Report(Ok(_)))).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_report_that_is_refused_is_told_and_the_next_one_arrives() {
    let server = Server::start().await;
    let mut running = Running::start(&server, &[("session_id", "refused-1")]);
    running.until("session", |update| matches!(update, Update::Opened(_))).await;
    // Nothing was seen yet.
    running.touch(1);
    running.until("refusal", |update| matches!(update, Update::Report(Err(_)))).await;
    let (level, said) = running.bridge.diagnostics().get("report").unwrap();
    assert!(level == Level::Error && said.contains("NO_VISUAL_PRIOR"), "{said}");

    running.bridge.take(Inbound::TfStatic(camera()), Instant::now());
    running.bridge.take(Inbound::Cloud(cloud(500 * MS)), Instant::now());
    running.until("view", |update| matches!(update, Update::View(Ok(_)))).await;
    running.touch(2);
    running.until("report", |update| matches!(update, Update::Report(Ok(_)))).await;
    assert_eq!(server.results("refused-1").await.len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_in_another_frame_is_not_driven() {
    let server = Server::start().await;
    let mut first = Running::start(&server, &[("session_id", "frames-1")]);
    first.until("session", |update| matches!(update, Update::Opened(_))).await;
    let mut second = Running::start(&server, &[("session_id", "frames-1"), ("frame_id", "world")]);
    second.until("refusal", |update| matches!(update, Update::Session(Err(_)))).await;
    let (level, said) = second.bridge.diagnostics().get("session").unwrap();
    assert!(level == Level::Error && said.contains("\"base\"") && said.contains("\"world\""), "{said}");
    let answer = second.bridge.outbox().ask(Command::Propose(1)).unwrap().await.unwrap();
    assert!(answer.unwrap_err().contains("~/create"));
}
