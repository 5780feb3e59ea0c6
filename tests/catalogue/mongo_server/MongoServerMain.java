import de.bwaldvogel.mongo.MongoServer;
import de.bwaldvogel.mongo.backend.h2.H2Backend;
import org.h2.mvstore.MVStore;

/** Serves the database in the file args[0] on port args[1] of the loopback interface, 0 for any; prints the port when it is ready. */
public final class MongoServerMain {
    public static void main(String[] args) {
        MVStore store = MVStore.open(args[0]);
        store.setAutoCommitDelay(10);
        MongoServer server = new MongoServer(new H2Backend(store));
        server.bind("127.0.0.1", Integer.parseInt(args[1]));
        Runtime.getRuntime().addShutdownHook(new Thread(server::shutdownNow));
        System.out.println(server.getLocalAddress().getPort());
    }
}
