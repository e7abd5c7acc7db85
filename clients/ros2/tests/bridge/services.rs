//! The services over DDS, called by a node of ros2-client as those of Fast DDS call them.

use std::time::Duration;

use palpate_client::proto::v1::contact_result::Outcome;
use palpate_client::proto::v1::{AddVisualPriorRequest, ProposeContactsRequest, RejectReason, SessionState};
use palpate_client::visual_prior;
use palpate_ros2::messages::{
    CreateSessionRequest, CreateSessionResponse, FinishRequest, FinishResponse, ProposeRequest,
    ProposeResponse, RejectRequest, RejectResponse, TriggerRequest, TriggerResponse,
};
use palpate_ros2::node::{Network, run};
use ros2_client::qos::{History, QosProfile};
use ros2_client::{
    Context, ContextOptions, Message, Name, Node, NodeName, NodeOptions, ServiceMapping, ServiceTypeName,
};
use tokio::time::{sleep, timeout};

use crate::harness::{LONG, Server, names};
use crate::robot::{CENTER, RADIUS};

/// Who calls: a node beside the bridge.
struct Caller {
    context: Context,
    node: Node,
}

impl Caller {
    /// Calls a service of the bridge.
    async fn call<Q, A>(&mut self, service: &str, package: &str, kind: &str, request: Q) -> A
    where
        Q: Message + Clone + 'static,
        A: Message + 'static,
    {
        let qos = QosProfile::publisher_default().history(History::KeepLast { depth: 10 });
        let name = Name::new("/palpate", service).unwrap();
        let kind = ServiceTypeName::new(package, kind);
        let client = self
            .node
            .create_client::<Q, A>(ServiceMapping::Enhanced, &name, &kind, qos.clone(), qos)
            .unwrap();
        self.discover(service).await;
        timeout(LONG, client.async_call_service(request)).await.expect("an answer comes").unwrap()
    }

    /// Waits until both topics of a service are known here, and then for the bridge to know of this side, which it
    /// tells nobody. `wait_for_service` now and then misses what was known before it was called.
    async fn discover(&self, service: &str) {
        let (asks, answers) = (format!("rq/palpate/{service}Request"), format!("rr/palpate/{service}Reply"));
        let known = async {
            let here = self.context.domain_participant();
            let hears = || {
                here.discovered_readers().iter().any(|one| one.subscription_topic_data.topic_name() == &asks)
            };
            let speaks = || {
                here.discovered_writers().iter().any(|one| one.publication_topic_data.topic_name == answers)
            };
            while !(hears() && speaks()) {
                sleep(Duration::from_millis(50)).await;
            }
        };
        timeout(LONG, known).await.expect("the service is there");
        sleep(Duration::from_secs(1)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_is_created_proposed_for_rejected_in_and_finished_by_services() {
    let server = Server::start().await;
    let parameters = server.parameters(&[("create_session", "false"), ("rmw", "rmw_fastrtps_cpp")]);
    // Another domain for each run, so that two beside each other do not meet.
    let domain = 101 + u16::try_from(std::process::id() % 100).unwrap();
    let network = Network { domain, is_local: false, rmw: String::new() };
    tokio::spawn(async move { run(parameters, &names(&[]), &network).await.unwrap() });

    let context = Context::with_options(ContextOptions::new().domain_id(domain)).unwrap();
    let mut node = context.new_node(NodeName::new("/", "caller").unwrap(), NodeOptions::new()).unwrap();
    tokio::spawn(node.spinner().unwrap().spin());

    let mut caller = Caller { context, node };
    let early: ProposeResponse =
        caller.call("propose", "palpate_msgs", "Propose", ProposeRequest { top_k: 1 }).await;
    assert!(!early.success && early.message.contains("~/create"), "{early:?}");

    let config = r#"{"method": "METHOD_PAPER", "icosphere_subdivisions": 3}"#.to_owned();
    let request = CreateSessionRequest { session_id: "called-1".to_owned(), config, ..Default::default() };
    let created: CreateSessionResponse =
        caller.call("create", "palpate_msgs", "CreateSession", request.clone()).await;
    assert!(created.success && created.session_id == "called-1", "{created:?}");
    let twice: CreateSessionResponse = caller.call("create", "palpate_msgs", "CreateSession", request).await;
    assert!(!twice.success && twice.message.contains("SESSION_EXISTS"), "{twice:?}");

    // Somebody else shows the patch; the bridge notices by itself or when it is asked.
    let [x, y, z] = CENTER;
    let patch: Vec<_> = (0..40)
        .map(|at| {
            let (turn, away) = (f64::from(at) * 2.4, 0.004 * f64::from(at).sqrt());
            [x + away * turn.cos(), y + away * turn.sin(), z + (RADIUS * RADIUS - away * away).sqrt()]
        })
        .collect();
    let client = server.client().await;
    let prior = Some(visual_prior(&patch, Some([x, y, 0.6])));
    let view = AddVisualPriorRequest { session_id: "called-1".to_owned(), prior, ..Default::default() };
    client.add_visual_prior(view).await.unwrap();

    let proposed: ProposeResponse =
        caller.call("propose", "palpate_msgs", "Propose", ProposeRequest { top_k: 2 }).await;
    assert!(proposed.success, "{proposed:?}");
    assert_eq!(proposed.revision, 2);
    let best = ProposeContactsRequest { session_id: "called-1".to_owned(), ..Default::default() };
    let best = client.propose_contacts(best).await.unwrap().candidates.remove(0);
    let request = RejectRequest { reason: 2, detail: "the wall".to_owned(), ..Default::default() };
    let rejected: RejectResponse = caller.call("reject", "palpate_msgs", "Reject", request).await;
    assert!(rejected.success && rejected.revision == 3, "{rejected:?}");
    let results = server.results("called-1").await;
    let Some(Outcome::Rejected(reason)) = &results[0].outcome else { panic!("{results:?}") };
    assert_eq!((reason.reason(), reason.detail.as_str()), (RejectReason::Collision, "the wall"));
    assert_eq!(results[0].candidate_id, best.candidate_id);

    let missed: TriggerResponse =
        caller.call("no_contact", "std_srvs", "Trigger", TriggerRequest::default()).await;
    assert!(missed.success, "{missed:?}");
    assert!(matches!(server.results("called-1").await[1].outcome, Some(Outcome::NoContact(_))));

    let request = FinishRequest { note: "enough".to_owned() };
    let finished: FinishResponse = caller.call("finish", "palpate_msgs", "Finish", request).await;
    assert!(finished.success, "{finished:?}");
    let session = client.get_session("called-1").await.unwrap();
    assert_eq!((session.state(), session.finish_note.as_str()), (SessionState::Finished, "enough"));
}
