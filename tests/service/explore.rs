//! The whole loop on one stream, and what happens to it when something goes wrong.

use palpate_client::proto::v1::explore_request::Message as RequestMessage;
use palpate_client::proto::v1::explore_response::Message as ReplyMessage;
use palpate_proto::v1;
use tokio::sync::mpsc;
use tokio_stream::StreamExt;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;

use crate::harness::{
    Caller, Proxy, Server, cap, creation, miss, patient_client, prior, question, reply, soon, touch,
};

/// One end of an exploration stream.
struct Line {
    to: mpsc::Sender<v1::ExploreRequest>,
    from: Streaming<v1::ExploreResponse>,
}

impl Line {
    async fn open(caller: &Caller) -> Self {
        let (to, messages) = mpsc::channel(8);
        let from = reply(caller.exploration().explore(ReceiverStream::new(messages))).await.unwrap();
        Self { to, from }
    }

    async fn say(&self, id: u64, request_id: &str, said: RequestMessage) {
        let message = v1::ExploreRequest { id, request_id: request_id.into(), message: Some(said) };
        self.to.send(message).await.unwrap();
    }

    /// The next message, which must answer the message `id`.
    async fn hear(&mut self, id: u64) -> ReplyMessage {
        let heard = soon("an answer", self.from.next()).await.unwrap().unwrap();
        assert_eq!(heard.in_reply_to, id, "{heard:?}");
        heard.message.unwrap()
    }

    /// The fields or the reason of the problem that answers the message `id`.
    async fn refused(&mut self, id: u64) -> String {
        let ReplyMessage::Problem(problem) = self.hear(id).await else { panic!("a problem") };
        assert!(problem.code != 0 && !problem.message.is_empty(), "{problem:?}");
        problem.fields.first().map_or(problem.reason, |field| field.field.clone())
    }
}

fn open(session_id: &str) -> v1::ExploreOpen {
    v1::ExploreOpen { session_id: session_id.into(), top_k: 1, ..Default::default() }
}

#[tokio::test]
async fn a_stream_carries_the_whole_loop_and_survives_what_is_refused() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.create(creation("ball")).await.unwrap();
    let mut line = Line::open(&caller).await;
    line.say(1, "", RequestMessage::Ping(v1::Ping { nonce: 9 })).await;
    assert_eq!(line.hear(1).await, ReplyMessage::Pong(v1::Ping { nonce: 9 }));
    line.say(2, "", RequestMessage::VisualPrior(cap())).await;
    assert_eq!(line.refused(2).await, "message", "the stream is not open yet");
    line.say(3, "", RequestMessage::Open(open("nowhere"))).await;
    assert_eq!(line.refused(3).await, "SESSION_NOT_FOUND");
    line.say(4, "", RequestMessage::Open(v1::ExploreOpen { send_mesh: true, ..open("ball") })).await;
    let ReplyMessage::Opened(session) = line.hear(4).await else { panic!("opened") };
    assert_eq!(session, caller.get("ball").await.unwrap());
    line.say(5, "", RequestMessage::Open(open("ball"))).await;
    assert_eq!(line.refused(5).await, "open", "only once");
    line.say(6, "", RequestMessage::Propose(question("", 1))).await;
    assert_eq!(line.refused(6).await, "NO_VISUAL_PRIOR");

    line.say(7, "", RequestMessage::VisualPrior(v1::VisualPrior { uncertainty: Some(f64::NAN), ..cap() }))
        .await;
    assert_eq!(line.refused(7).await, "visual_prior.uncertainty");
    line.say(8, "prior", RequestMessage::VisualPrior(cap())).await;
    let ReplyMessage::Prior(seen) = line.hear(8).await else { panic!("prior") };
    let ReplyMessage::Mesh(mesh) = line.hear(8).await else { panic!("mesh") };
    assert_eq!((mesh.revision, seen.candidates.len()), (2, 1));

    let mut nonsense = touch(&seen.candidates[0], 0.001);
    nonsense.candidate_id = "417".into();
    line.say(9, "touch", RequestMessage::Result(nonsense)).await;
    assert_eq!(line.refused(9).await, "result.candidate_id");
    line.say(10, "touch", RequestMessage::Result(touch(&seen.candidates[0], 0.001))).await;
    let ReplyMessage::Accepted(touched) = line.hear(10).await else { panic!("accepted") };
    let ReplyMessage::Mesh(mesh) = line.hear(10).await else { panic!("mesh") };
    assert_eq!((touched.seq, touched.duplicate, mesh.revision), (3, false, 3));
    line.say(11, "", RequestMessage::Propose(question("", 3))).await;
    let ReplyMessage::Candidates(proposal) = line.hear(11).await else { panic!("candidates") };
    assert_eq!(proposal, caller.propose(question("ball", 3)).await.unwrap());
    assert_eq!(touched.session.unwrap(), caller.get("ball").await.unwrap());

    drop(line.to);
    assert!(soon("the end", line.from.next()).await.is_none(), "the stream ends with the robot's side");
}

#[tokio::test]
async fn a_stream_that_is_opened_again_tells_what_was_missed_and_counts_nothing_twice() {
    let server = Server::start().await;
    let caller = server.grpc();
    let first = caller.begin("ball").await;
    let mut line = Line::open(&caller).await;
    line.say(1, "", RequestMessage::Open(open("ball"))).await;
    line.hear(1).await;
    line.say(2, "touch", RequestMessage::Result(touch(&first, 0.001))).await;
    let ReplyMessage::Accepted(touched) = line.hear(2).await else { panic!("accepted") };
    line.say(3, "miss", RequestMessage::Result(miss(&touched.candidates[0]))).await;
    let ReplyMessage::Accepted(missed) = line.hear(3).await else { panic!("accepted") };
    drop(line);

    let mut line = Line::open(&caller).await;
    let resume = v1::ExploreOpen { resume_after_revision: 2, top_k: 5, ..open("ball") };
    line.say(1, "", RequestMessage::Open(resume)).await;
    let ReplyMessage::Opened(session) = line.hear(1).await else { panic!("opened") };
    assert_eq!(session.revision, 4);
    assert_eq!(line.hear(1).await, ReplyMessage::Accepted(touched));
    assert_eq!(line.hear(1).await, ReplyMessage::Accepted(missed.clone()));
    let candidate = missed.candidates[0].clone();
    line.say(2, "miss", RequestMessage::Result(miss(&candidate))).await;
    assert_eq!(line.refused(2).await, "REQUEST_ID_REUSED", "another candidate is another message");
    line.say(3, "next", RequestMessage::Result(miss(&candidate))).await;
    let ReplyMessage::Accepted(next) = line.hear(3).await else { panic!("accepted") };
    line.say(4, "next", RequestMessage::Result(miss(&candidate))).await;
    let ReplyMessage::Accepted(again) = line.hear(4).await else { panic!("accepted") };
    assert_eq!(again, v1::ReportContactResponse { duplicate: true, ..next });
    assert_eq!(caller.get("ball").await.unwrap().revision, 5);

    let mut line = Line::open(&caller).await;
    line.say(1, "", RequestMessage::Open(v1::ExploreOpen { resume_after_revision: 6, ..open("ball") })).await;
    assert_eq!(line.refused(1).await, "open.resume_after_revision");
}

#[tokio::test]
async fn the_client_explores_on_one_stream_through_a_restart_of_the_server() {
    let mut server = Server::start().await;
    let proxy = Proxy::to(server.address).await;
    let client = patient_client(&proxy.url()).await;
    client.create_session(creation("ball")).await.unwrap();
    let mut stream = client.explore(open("ball")).await.unwrap();
    let mut next = stream.add_visual_prior(cap()).await.unwrap().candidates.remove(0);
    for step in 0..4 {
        if step == 2 {
            server = server.restart().await;
            proxy.switch(server.address);
        }
        let reply = stream.report(touch(&next, 0.001)).await.unwrap();
        assert_eq!(reply.seq, 3 + step);
        next = reply.candidates.into_iter().next().unwrap();
    }
    // The same touches in unary calls lead to the same state.
    let caller = server.grpc();
    let first = caller.create(creation("unary")).await.map(|_| prior("unary")).unwrap();
    let first = caller.add_prior(first).await.unwrap().candidates.remove(0);
    caller.go_on("unary", first, 4).await;
    let hashes = |log: Vec<v1::Event>| log.into_iter().map(|event| event.state_hash).collect::<Vec<_>>();
    assert_eq!(hashes(caller.log("ball").await), hashes(caller.log("unary").await));
}
