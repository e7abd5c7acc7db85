//! The log on PostgreSQL: what is insisted on, what is said where it cannot be used, and how statements keep to shards.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use palpate_proto::v1;
use palpate_server::access::Scope;
use serde_json::{Value, json};

use crate::harness::database::{address, texts};
use crate::harness::postgres::Installation;
use crate::harness::truth::keep_ball;
use crate::harness::{
    Authority, Http, Process, Server, accepted, creation, miss, new_token, report, run, run_with, send, soon,
};
use crate::series::complete;

#[tokio::test]
async fn a_database_that_would_lose_what_is_acknowledged_or_cannot_be_reached_is_refused_in_words() {
    let Some(installation) = Installation::find() else { return };
    let careless = installation.start(&["fsync=off"]).await;
    let database = address(&careless.url(), "palpate").await;
    let refusal = Process::refusal(database.as_ref()).await;
    assert!(refusal.contains("fsync is \"off\" but must be \"on\""), "{refusal}");
    drop(careless);

    let postgres = installation.start(&["synchronous_commit=off"]).await;
    let port = postgres.port;
    let missing =
        Process::refusal(format!("postgres://postgres:s3cret@127.0.0.1:{port}/none").as_ref()).await;
    assert!(missing.contains("createdb") && missing.contains(&format!("127.0.0.1:{port}/none")), "{missing}");
    let nobody = Process::refusal("postgres://postgres:s3cret@127.0.0.1:1/palpate".as_ref()).await;
    assert!(nobody.contains("does PostgreSQL run there"), "{nobody}");
    let wrong = Process::refusal("postgres://postgres:s3cret@127.0.0.1:port/palpate".as_ref()).await;
    assert!(wrong.contains("postgres://USER@HOST:PORT/DATABASE"), "{wrong}");
    for said in [missing, nobody, wrong] {
        assert!(!said.contains("s3cret") && !said.contains("panicked"), "{said}");
    }

    // What others set for convenience, servers set back for themselves; the address may come from a file.
    let database = address(&postgres.url(), "palpate").await;
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("address"), format!("{database}\n")).unwrap();
    let file = folder.path().join("address");
    let server = Process::serve_with("palpate.db".as_ref(), |command| {
        command.env("PALPATE_DATABASE_FILE", &file);
    })
    .await;
    server.caller(crate::harness::Transport::Grpc).begin("mug").await;
    let doctor = run_with(folder.path(), &["doctor"], |command| {
        command.env("PALPATE_DATABASE_FILE", &file);
    })
    .await;
    assert!(
        doctor.out.contains("synchronous_commit is off") && doctor.out.contains("all links followed"),
        "{}",
        doctor.out
    );
    let config = run_with(folder.path(), &["config", "--show"], |command| {
        command.env("PALPATE_DATABASE", "postgres://lab:s3cret@db/palpate");
    })
    .await;
    assert!(config.out.contains("postgres://lab:***@db/palpate"), "{}", config.out);
    let copied = run(folder.path(), &["backup", "--database", &database, "--to", "copy.db"]).await;
    assert!(copied.code == Some(1) && copied.err.contains("palpate migrate --from"), "{}", copied.err);
}

#[tokio::test]
async fn a_database_that_comes_back_is_found_again_and_nothing_is_answered_meanwhile() {
    let Some(installation) = Installation::find() else { return };
    let postgres = installation.start(&[]).await;
    let server = Server::on(address(&postgres.url(), "palpate").await.parse().unwrap()).await;
    let next = server.grpc().begin("mug").await;
    let port = postgres.port;
    let data = postgres.kill();
    let said = report("mug", miss(&next), "meanwhile");
    let client = server.client().await;
    let waiting = tokio::spawn(async move { client.report_contact(said).await });
    let down = async {
        while send(server.http().get("/readyz")).await.status() != 503 {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    soon("the server is not ready", down).await;
    let _postgres = installation.begin(&data, port, &[]).await;
    let reply = soon("the robot's report", waiting).await.unwrap().unwrap();
    assert_eq!(reply.seq, 3);
    assert!(accepted(server.http().get("/readyz")).await.is_ok());
    let seqs: Vec<i64> = server.grpc().log("mug").await.iter().map(|event| event.seq).collect();
    assert_eq!(seqs, [1, 2, 3]);
}

#[tokio::test]
async fn the_way_to_the_database_is_encrypted_and_its_certificate_is_looked_at() {
    let Some(installation) = Installation::find() else { return };
    let authority = Authority::new();
    authority.write("server", &authority.issue("the database"));
    // PostgreSQL reads them as its own user, who alone may read the key.
    let files = ["server.pem", "server-key.pem"].map(|name| installation.take(&authority.path().join(name)));
    let settings = [
        "ssl=on".to_owned(),
        format!("ssl_cert_file={}", files[0].display()),
        format!("ssl_key_file={}", files[1].display()),
    ];
    let postgres = installation.start(&settings.each_ref().map(String::as_str)).await;
    let plain = address(&postgres.url(), "palpate").await;
    let trusting = |authority: &Authority| {
        format!("{plain}?sslmode=verify-full&sslrootcert={}", authority.path().join("ca.pem").display())
    };
    let refusal = Process::refusal(trusting(&Authority::new()).as_ref()).await;
    assert!(refusal.contains("check sslmode and sslrootcert"), "{refusal}");
    let server = Process::serve(trusting(&authority).as_ref()).await;
    server.caller(crate::harness::Transport::Grpc).begin("mug").await;
    let folder = tempfile::tempdir().unwrap();
    for (address, is_warned) in [(trusting(&authority), false), (format!("{plain}?sslmode=disable"), true)] {
        let doctor = run(folder.path(), &["doctor", "--database", &address]).await;
        assert_eq!(doctor.out.contains("can be read on its way"), is_warned, "{}", doctor.out);
    }
}

#[tokio::test]
async fn a_ticket_of_one_server_opens_one_request_at_any_of_them() {
    let Some(installation) = Installation::find() else { return };
    let postgres = installation.start(&[]).await;
    let database = address(&postgres.url(), "palpate").await;
    let location: palpate_server::Location = database.parse().unwrap();
    let mut tokens = palpate_server::access::Tokens::open(&location).await.unwrap();
    let token = tokens.create(&new_token("wall", Scope::Robot)).await.unwrap().token;
    tokens.close().await.unwrap();
    let mut servers = Vec::new();
    for _ in 0..2 {
        servers.push(
            Process::serve_with(database.as_ref(), |command| {
                command.arg("--require-tokens");
            })
            .await,
        );
    }
    let issued = servers[0].http().with_token(&token).post("/v1/tickets", &json!({}));
    let issued: Value = serde_json::from_str(&accepted(issued).await.unwrap().text().await.unwrap()).unwrap();
    let path = format!("/v1/sessions?ticket={}", issued["ticket"].as_str().unwrap());
    let open = async |http: Http| send(http.get(&path)).await.status().as_u16();
    assert_eq!(open(servers[1].http()).await, 200);
    assert_eq!(open(servers[0].http()).await, 401, "once");
}

/// A statement of PostgreSQL's log, with its values.
#[derive(Debug)]
struct Logged {
    /// The backend, and its transaction.
    of: (String, String),
    text: String,
    values: Vec<String>,
}

/// What the log of a server that logs all statements says, each line of which begins with backend and transaction.
fn statements(log: &str) -> Vec<Logged> {
    let mut all: Vec<Logged> = Vec::new();
    let mut last_is_statement = false;
    for line in log.lines() {
        let begins = line.strip_prefix("@@").and_then(|rest| rest.split_once(" @@ "));
        let Some((of, rest)) = begins else {
            // A statement of several lines goes on.
            if last_is_statement && let Some(last) = all.last_mut() {
                last.text.push(' ');
                last.text.push_str(line.trim());
            }
            continue;
        };
        let (backend, transaction) = of.split_once(' ').unwrap();
        let executed = rest.split_once("execute ").and_then(|(_, rest)| rest.split_once(": "));
        let simple = rest.split_once("statement: ");
        last_is_statement = false;
        if let Some(text) = executed.or(simple).map(|(_, text)| text) {
            let of = (backend.to_owned(), transaction.to_owned());
            all.push(Logged { of, text: text.trim().to_owned(), values: Vec::new() });
            last_is_statement = true;
        } else if let Some((_, values)) = rest.split_once("parameters: ")
            && let Some(last) = all.iter_mut().rev().find(|logged| logged.of.0 == backend)
        {
            // $1 = 'mug', $2 = '7'
            let values = values.split(", $").filter_map(|value| value.split_once(" = "));
            last.values = values.map(|(_, value)| value.trim_matches('\'').to_owned()).collect();
        }
    }
    all
}

/// Which session a statement is about: the value that `session_id` is compared with, or that is inserted as it.
fn session_of(logged: &Logged) -> Option<String> {
    let text = &logged.text;
    let value = |place: &str| {
        let number: usize = place.trim_start_matches('$').parse().ok()?;
        logged.values.get(number - 1).cloned()
    };
    if let Some((_, rest)) = text.split_once("session_id = $") {
        let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
        return value(&rest[..end]);
    }
    let (columns, rest) = text.strip_prefix("insert into")?.split_once('(')?.1.split_once(')')?;
    let place = columns.split(',').position(|column| column.trim() == "session_id")?;
    let values = rest.split_once('(')?.1.split(')').next()?;
    value(values.split(',').nth(place)?.trim())
}

#[tokio::test]
async fn each_transaction_keeps_to_one_session_and_nothing_rests_on_what_engines_that_shard_lack() {
    let Some(installation) = Installation::find() else { return };
    let postgres = installation.start(&["log_statement=all", "log_line_prefix=@@%p %v @@ "]).await;
    let database = address(&postgres.url(), "palpate").await;
    let server = Server::on(database.parse().unwrap()).await;
    let caller = server.grpc();
    for name in ["mug", "pot"] {
        let next = caller.begin(name).await;
        caller.go_on(name, next, 4).await;
        caller.set_reference(keep_ball(name)).await.unwrap();
    }
    let fork = v1::ForkSessionRequest {
        session_id: "pot".into(),
        new_session_id: "copy".into(),
        request_id: "fork".into(),
        ..Default::default()
    };
    caller.fork(fork).await.unwrap();
    let unnamed = v1::CreateSessionRequest { request_id: "unnamed".into(), ..Default::default() };
    let made = caller.create(unnamed.clone()).await.unwrap();
    assert_eq!(caller.create(unnamed).await.unwrap(), made);
    let labels = [("colour".to_owned(), "red".to_owned())].into();
    caller.create(v1::CreateSessionRequest { labels, ..creation("red") }).await.unwrap();
    let deletion = v1::DeleteSessionRequest {
        session_id: "pot".into(),
        request_id: "delete".into(),
        ..Default::default()
    };
    caller.delete(deletion).await.unwrap();
    server.stop().await;

    let all = statements(&installation.logged(postgres.port));
    // Who makes the tables is not asked; the tables themselves are, below.
    let all: Vec<Logged> =
        all.into_iter().filter(|logged| !logged.text.contains("_sqlx_migrations")).collect();
    for logged in &all {
        let text = logged.text.to_lowercase();
        for lacking in
            ["nextval", "currval", "advisory", "listen ", "notify ", "serial", "jsonb", "for update"]
        {
            assert!(!text.contains(lacking), "{text}");
        }
    }
    let mut transactions: BTreeMap<&(String, String), Vec<&Logged>> = BTreeMap::new();
    for logged in &all {
        transactions.entry(&logged.of).or_default().push(logged);
    }
    let mut sharded = 0;
    for statements in transactions.values() {
        let changes = |logged: &&&Logged| {
            let text = &logged.text;
            ["insert", "update", "delete", "select"].iter().any(|verb| text.starts_with(verb))
        };
        let about: Vec<&&Logged> = statements.iter().filter(changes).collect();
        let is_cache =
            about.iter().any(|logged| logged.text.contains("checkpoints") || logged.text.contains("shown"));
        if about.len() < 2 || is_cache {
            continue;
        }
        let sessions: BTreeSet<Option<String>> = about.iter().map(|logged| session_of(logged)).collect();
        assert!(sessions.len() == 1 && !sessions.contains(&None), "{sessions:?}: {about:#?}");
        sharded += 1;
    }
    assert!(sharded > 12, "transactions of several statements: {sharded}");

    // The tables: no sequence, no trigger, and each key of what belongs to a session begins with it.
    let query = async |text: &'static str| crate::harness::database::texts(&database, text).await;
    assert!(query("select relname::text from pg_class where relkind = 'S'").await.is_empty());
    assert!(query("select tgname::text from pg_trigger where not tgisinternal").await.is_empty());
    let keys = query(
        "select c.relname || ' ' || a.attname from pg_index i
         join pg_class c on c.oid = i.indrelid join pg_namespace n on n.oid = c.relnamespace
         join pg_attribute a on a.attrelid = c.oid and a.attnum = i.indkey[0]
         where i.indisunique and n.nspname = 'public' order by 1",
    )
    .await;
    let elsewhere: Vec<&str> = keys
        .iter()
        .filter(|key| !key.ends_with(" session_id") && !key.starts_with("_sqlx"))
        .map(|key| key.split_once(' ').unwrap().0)
        .collect();
    assert_eq!(elsewhere, ["created_requests", "log", "tickets", "tokens"], "{keys:?}");
}

/// What a server of another version of the method keeps of the states of this one: as many rows, of its own.
const OF_ANOTHER_VERSION: [&str; 2] = [
    "insert into checkpoints (session_id, created_us, seq, algorithm_version, state_hash, bytes, shown, size, kept_us)
     select session_id, created_us, seq, 'another', state_hash, 'nonsense', shown, size, kept_us from checkpoints
     returning session_id",
    "insert into reference_errors (session_id, seq, algorithm_version, surface_distance_m)
     select session_id, seq, 'another', 12.5 from reference_errors returning session_id",
];

#[tokio::test]
async fn what_a_server_of_another_version_keeps_beside_the_log_is_neither_used_nor_touched() {
    let Some(installation) = Installation::find() else { return };
    let postgres = installation.start(&[]).await;
    let database = address(&postgres.url(), "palpate").await;
    let server = Server::on(database.parse().unwrap()).await;
    let caller = server.grpc();
    let next = caller.begin("mug").await;
    caller.set_reference(keep_ball("mug")).await.unwrap();
    let next = caller.go_on("mug", next, 4).await;
    let mesh = v1::GetMeshRequest { session_id: "mug".into(), revision: 4, ..Default::default() };
    let before = (caller.mesh(mesh.clone()).await.unwrap(), complete(&caller, "mug").await.rows);
    server.stop().await;
    let mut kept = Vec::new();
    for statement in OF_ANOTHER_VERSION {
        kept.push(texts(&database, statement).await.len());
    }
    assert!(kept.iter().all(|rows| *rows >= 4), "{kept:?}");

    let server = Server::on(database.parse().unwrap()).await;
    let caller = server.grpc();
    let after = (caller.mesh(mesh).await.unwrap(), complete(&caller, "mug").await.rows);
    assert_eq!(after, before);
    caller.go_on("mug", next, 2).await;
    let longer = complete(&caller, "mug").await.rows;
    assert_eq!(longer.len(), before.1.len() + 2);
    assert_eq!(longer[..before.1.len()], before.1[..]);
    server.stop().await;
    for (table, rows) in [("checkpoints", kept[0]), ("reference_errors", kept[1])] {
        let versions = texts(&database, format!("select algorithm_version from {table}")).await;
        let others = versions.iter().filter(|version| *version == "another").count();
        assert_eq!(others, rows, "{table}");
        assert!(versions.len() - others >= rows + 2, "{table}: {versions:?}");
    }
}
